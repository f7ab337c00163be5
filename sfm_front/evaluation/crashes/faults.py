"""Ways to stop a run from outside."""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
from enum import Enum


class Fault(Enum):
    """What hits a run."""

    KILL = "SIGKILL"
    TERMINATE = "SIGTERM"
    INTERRUPT = "SIGINT"
    DISK_FULL = "disk full"


def strike(process: subprocess.Popen[str], fault: Fault, room_bytes: int = 0) -> None:
    """Do it to a running process.

    A full disk is a limit of ``room_bytes`` on the size of each file the process writes, set while
    it runs: SQLite's, pycolmap's and Python's writes beyond it fail alike, and no rights are
    needed. They fail with EFBIG, where a full disk says ENOSPC and a quota EDQUOT. Linux alone can
    do this.
    """
    if fault is not Fault.DISK_FULL:
        process.send_signal(signal.Signals[fault.value])
    elif sys.platform == "linux" and process.poll() is None:
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (room_bytes, room_bytes))
