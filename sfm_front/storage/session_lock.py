"""One writer per output folder; whether there is one."""

from __future__ import annotations

import os
import socket
import sys
from contextlib import suppress
from pathlib import Path

from filelock import FileLock, Timeout

from sfm_front.errors import InputError
from sfm_front.runtime.closeable import Closeable

LOCK = ".sfm_front.lock"
OWNER = ".sfm_front.owner"

_PATIENCE_S = 0.1


def is_locked(output: Path) -> bool:
    """Whether a process writes to the folder right now, as far as can be told.

    Never in the way of one that begins at this moment: a lock that is only tried is shared, and a
    session waits for it.
    """
    try:
        with (output / LOCK).open("rb") as file:
            return not _is_free(file.fileno())
    except FileNotFoundError:
        return False
    except OSError:  # On some network drives there are no locks.
        return True


def _is_free(descriptor: int) -> bool:
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            msvcrt.locking(descriptor, msvcrt.LK_UNLCK, 1)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    return True


class SessionLock(Closeable):
    """Held while a session writes to a folder. The system frees the lock of a killed process."""

    def __init__(self, output: Path) -> None:
        """Raises InputError, naming the process, if another one holds the lock."""
        self._output = output
        self._lock = FileLock(output / LOCK)
        try:
            # Longer than anybody takes who only looks whether it is held.
            self._lock.acquire(timeout=_PATIENCE_S, poll_interval=_PATIENCE_S / 10)
        except Timeout:
            raise InputError(
                f"{output}: {self._owner()} is writing to it. Wait for it, or give another "
                "--output."
            ) from None
        # The lock holds without a name, too, as on a full disk.
        with suppress(OSError):
            (output / OWNER).write_text(f"process {os.getpid()} on {socket.gethostname()}")

    def _owner(self) -> str:
        try:
            return (self._output / OWNER).read_text().strip() or "another process"
        except OSError:
            return "another process"

    def close(self) -> None:
        with suppress(OSError):
            (self._output / OWNER).unlink()
        if os.name == "nt":
            self._lock.release()
        # Elsewhere before the release: after it, the file may be another process's lock. Windows
        # does not remove a file that is open.
        with suppress(OSError):
            (self._output / LOCK).unlink()
        self._lock.release()
