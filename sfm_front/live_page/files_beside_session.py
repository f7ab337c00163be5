"""Keep ``report.html`` and ``scene.html`` fresh while a session runs, by processes that step back
behind it."""

from __future__ import annotations

import subprocess
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread

from sfm_front.reports.html import FILE, SCENE_FILE
from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.subprocess_env import module_command, module_environment
from sfm_front.storage.atomic import is_partial
from sfm_front.storage.written_models import STATE

_EVERY_S = 30.0
# Of a large session they take long: they get at most this share of a processor's time.
_MAX_SHARE = 0.02
_TICK_S = 0.5


class FilesBesideSession(Closeable):
    """Writes the files of ``output`` anew when models have been written since the last time."""

    def __init__(self, output: Path, every_s: float = _EVERY_S) -> None:
        """Begins ``every_s`` from now, and leaves as much time between any two."""
        self._output = output
        self._every_s = every_s
        self._is_closed = Event()
        self._shown = self._models_written()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Nothing is written any more once this returns."""
        self._is_closed.set()
        self._thread.join()

    def _run(self) -> None:
        pause_s = self._every_s
        while not self._is_closed.wait(pause_s):
            pause_s = _TICK_S
            written = self._models_written()
            if written == self._shown:
                continue
            self._shown = written
            spent_s = 0.0
            # Without processes to be had, they come at the end.
            with suppress(OSError):
                spent_s = self._write()
            pause_s = max(self._every_s, spent_s / _MAX_SHARE)

    def _models_written(self) -> int | None:
        """When; None before the first time."""
        try:
            return (self._output / "sparse" / STATE).stat().st_mtime_ns
        except OSError:
            return None

    def _write(self) -> float:
        """Or leave it, where there is no time left; the seconds of a processor that it took."""
        process = subprocess.Popen(
            module_command("sfm_front.live_page.files_process", str(self._output)),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=module_environment(),
            # Ctrl-C is for the session.
            start_new_session=True,
        )
        while process.poll() is None:
            if self._is_closed.wait(_TICK_S):
                process.kill()
                process.wait()
                self._remove_partial()
        said, _ = process.communicate()
        with suppress(ValueError):
            return float(said)
        return 0.0  # It failed: where the output is gone, say.

    def _remove_partial(self) -> None:
        with suppress(OSError):
            for file in self._output.iterdir():
                if is_partial(file.name, FILE) or is_partial(file.name, SCENE_FILE):
                    file.unlink()
