"""Start the page beside a session, and let it go when the session has ended."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Thread

from sfm_front.live_page.address import FIRST_PORT
from sfm_front.live_page.extra import check_installed
from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.subprocess_env import module_command, module_environment

# A page that no browser shows ends within this time.
_ENDING_S = 2.0
_TICK_S = 0.25
_STAYS = "the live page stays while a browser shows it; close it there, or press Ctrl-C"

Note = Callable[[str], None]


class PageBesideSession(Closeable):
    """The page in a process of its own, so that the session's threads do not wait for it."""

    def __init__(self, output: Path, note: Note, port: int = FIRST_PORT) -> None:
        """``note`` is called with the page's address, from another thread, once it is known.

        Raises DependencyError if the page's library is not there.
        """
        check_installed()
        self._note = note
        self._output = output
        self._is_closed = False
        self._process = subprocess.Popen(
            module_command("sfm_front.live_page.page_process", str(output), str(port)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=module_environment(),
            encoding="utf-8",
            # Ctrl-C is for the session.
            start_new_session=True,
        )
        Thread(target=self._tell_address, daemon=True).start()

    def _tell_address(self) -> None:
        assert self._process.stdout is not None
        address = self._process.stdout.readline().strip()
        if address:
            self._note(f"live page: {address}")
        elif not self._is_closed:
            self._note(f"no live page: sfm-front view {self._output} --web says why")

    def stay(self, until: Callable[[], bool]) -> None:
        """The session has ended: wait until no browser shows the page any more, or ``until``."""
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.write("ended\n")
            self._process.stdin.flush()
        if not self._has_ended(_ENDING_S):
            self._note(_STAYS)
        while not (self._has_ended(_TICK_S) or until()):
            pass

    def _has_ended(self, within_s: float) -> bool:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(within_s)
            return True
        return False

    def close(self) -> None:
        self._is_closed = True
        self._process.kill()
        self._process.wait()
