"""One writer per output folder."""

from __future__ import annotations

import os
import socket
from pathlib import Path

from filelock import FileLock, Timeout

from sfm_front.errors import InputError
from sfm_front.runtime.closeable import Closeable

LOCK = ".sfm_front.lock"
OWNER = ".sfm_front.owner"


class SessionLock(Closeable):
    """Held while a session writes to a folder. The system frees the lock of a killed process."""

    def __init__(self, output: Path) -> None:
        """Raises InputError, naming the process, if another one holds the lock."""
        self._output = output
        self._lock = FileLock(output / LOCK)
        try:
            self._lock.acquire(timeout=0)
        except Timeout:
            raise InputError(
                f"{output}: {self._owner()} is writing to it. Wait for it, or give another "
                "--output."
            ) from None
        (output / OWNER).write_text(f"process {os.getpid()} on {socket.gethostname()}")

    def _owner(self) -> str:
        try:
            return (self._output / OWNER).read_text().strip() or "another process"
        except OSError:
            return "another process"

    def close(self) -> None:
        (self._output / OWNER).unlink(missing_ok=True)
        self._lock.release()
        (self._output / LOCK).unlink(missing_ok=True)
