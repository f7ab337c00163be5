"""One writer per output folder."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
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
