"""Whether anything has changed below a folder: by events, or by polling where none come."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from pathlib import Path

from watchfiles import Change, watch
from watchfiles.main import FileChange

TICK_S = 0.03
"""How long ``FolderChanges.wait`` waits, in seconds, if nothing changes."""


class FolderChanges:
    """Notices changes below a folder that exists, sub-folders included.

    It never fails: if the system sends no events, it polls; if that is impossible too, it
    notices nothing, and only listing the folder shows what has changed.
    """

    def __init__(
        self,
        folder: Path,
        *,
        exclude: Path | None,
        polling: bool,
        poll_s: float,
        note: Callable[[str], None],
    ) -> None:
        """``polling``: poll, every ``poll_s`` seconds, from the start. Nothing below ``exclude``
        counts. ``note`` hears, in a line, of each way of watching that cannot be had."""
        self._folder = folder
        # As events name them.
        self._root = folder.resolve()
        self._excluded = None if exclude is None else str(exclude.resolve())
        self._poll_s = poll_s
        self._note = note
        self._watching: Generator[set[FileChange], None, None] | None = None
        self.polls = polling
        self._start()

    def wait(self) -> bool:
        """Wait for a change, ``TICK_S`` at most; whether there has been one since the last call."""
        if self._watching is None:
            time.sleep(TICK_S)
            return False
        try:
            return bool(next(self._watching))
        # watchfiles' own error for what the system reports derives from RuntimeError.
        except (OSError, RuntimeError) as error:
            self._fail(error)
            return True

    def poll(self) -> None:
        """Do without events from now on."""
        if not self.polls:
            self.close()
            self.polls = True
            self._start()

    def close(self) -> None:
        if self._watching is not None:
            self._watching.close()
            self._watching = None

    def _start(self) -> None:
        self._watching = watch(
            self._root,
            watch_filter=self._counts,
            debounce=50,
            step=10,
            rust_timeout=round(TICK_S * 1000),
            yield_on_timeout=True,
            # None leaves it to watchfiles, which knows systems where events do not work.
            force_polling=self.polls or None,
            poll_delay_ms=round(self._poll_s * 1000),
            ignore_permission_denied=True,
        )
        try:
            next(self._watching)  # Begins only now.
        except (OSError, RuntimeError) as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        self.close()
        if not self._folder.is_dir():
            return  # Whoever asks will see that, and begin again when it is back.
        if self.polls:
            self._note(f"{self._folder}: cannot be polled, only listed from time to time: {error}")
        else:
            self._note(f"{self._folder}: the system sends no events, polling instead: {error}")
            self.poll()

    def _counts(self, _change: Change, path: str) -> bool:
        return self._excluded is None or not Path(path).is_relative_to(self._excluded)
