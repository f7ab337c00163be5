"""What the user reads while photos are taken in."""

from __future__ import annotations

import shutil
import time
from typing import TextIO

from sfm_front.events import ControlPointsRefused, Event, PhotoAdded
from sfm_front.reports.words import clock
from sfm_front.types import Skipped


class LiveLine:
    """A line that renews itself on a terminal; a line each time anywhere else."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._live = stream.isatty()

    def note(self, text: str) -> None:
        """A line of its own, kept."""
        self._erase()
        print(text, file=self._stream, flush=True)

    def end(self) -> None:
        self._erase()

    def _write(self, text: str) -> None:
        if not self._live:
            print(text, file=self._stream, flush=True)
            return
        width = shutil.get_terminal_size().columns - 1
        self._stream.write("\r\x1b[K" + text[:width])
        self._stream.flush()

    def _erase(self) -> None:
        if self._live:
            self._stream.write("\r\x1b[K")
            self._stream.flush()


class ProgressLine(LiveLine):
    """Where a reconstruction stands, photo by photo."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream)
        self._total = 0
        self._started = time.perf_counter()
        self._done = 0
        self._registered = 0
        self._points = 0
        self._is_finishing = False

    def expect(self, total: int) -> None:
        """Time counts from now, to ``total`` photos."""
        self._total = total
        self._started = time.perf_counter()

    def show(self, event: Event) -> None:
        """Count a photo and show where things stand. Of other events only what can be mended while
        photos come is told; the closing summary has all."""
        if isinstance(event, ControlPointsRefused) and not self._is_finishing:
            self.note(str(event))
        if isinstance(event, Skipped):
            self.note(f"skipped {event.name}: {event}")
        elif isinstance(event, PhotoAdded):
            self._registered, self._points = event.num_registered, event.num_points
        else:
            return
        self._done += 1
        # Nobody knows how many are still to come if a folder is watched.
        of = f"/{self._total}  " if self._total else "  "
        pace = f"  {_pace(self._started, self._done, self._total)}" if self._total else ""
        self._write(
            f"photo {self._done}{of}registered {self._registered}  points {self._points}{pace}"
        )

    def finishing(self) -> None:
        self._is_finishing = True
        self._write("last refinement, then writing the models …")


class CountLine(LiveLine):
    """How many photos are done; where there is no terminal, a line each tenth."""

    def __init__(self, what: str, stream: TextIO) -> None:
        super().__init__(stream)
        self._what = what
        self._started = time.perf_counter()

    def show(self, done: int, total: int) -> None:
        """To be called after each photo."""
        tenths_before, tenths = (10 * n // total for n in (done - 1, done))
        if self._live or tenths > tenths_before:
            self._write(f"{self._what} {done}/{total}  {_pace(self._started, done, total)}")


def _pace(started: float, done: int, total: int) -> str:
    seconds = (time.perf_counter() - started) / done
    return f"{seconds:.2f} s per photo  {clock(seconds * (total - done))} left"
