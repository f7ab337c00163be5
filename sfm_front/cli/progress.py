"""What the user reads while photos are taken in."""

from __future__ import annotations

import shutil
import time
from dataclasses import asdict
from typing import TextIO

from sfm_front.cli.heartbeat import Heartbeat
from sfm_front.cli.terminal import ERASE, is_terminal, printable_line
from sfm_front.events import (
    ControlPointsRefused,
    Event,
    FinishingBegan,
    ModelRefined,
    PhotoAdded,
)
from sfm_front.reports.event_words import finishing_words
from sfm_front.reports.words import clock, counted
from sfm_front.types import Skipped

# Photos without a place for any of them after which one wonders: most models start with three or
# four, streets with ten.
_WONDER_AFTER = 12
# For each photo, the last adjustment of a model takes so many times as long as its refinement
# before: 1.9 to 8.3 on four scenes of 38 to 75 photos, 3.5 on a synthetic flight of 2000.
_LAST_ADJUSTMENT = (2.0, 8.0)
# Whoever reads what will take less has waited for it.
_WORTH_SAYING_S = 20.0
_NONE_YET = (
    "no photo is placed yet: a model starts with two that see the same from clearly different "
    "places; they wait, and are tried again"
)


class LiveLine:
    """A line that renews itself on a terminal; a line each time anywhere else.

    ``quiet``: none of this.
    """

    def __init__(self, stream: TextIO, *, quiet: bool = False) -> None:
        self._stream = stream
        self._live = is_terminal(stream)
        self._quiet = quiet

    def note(self, text: str) -> None:
        """A line of its own, kept."""
        if not self._quiet:
            self._print(text)

    def keep(self, text: str) -> None:
        """The same, however quiet it is."""
        self._print(text)

    def end(self) -> None:
        if self._live and not self._quiet:
            self._stream.write(ERASE)
            self._stream.flush()

    def _print(self, text: str) -> None:
        # At once: a heartbeat may write between two calls.
        self._stream.write(f"{ERASE if self._live else ''}{printable_line(text)}\n")
        self._stream.flush()

    def _write(self, text: str) -> None:
        if self._quiet:
            return
        if not self._live:
            self._print(text)
            return
        width = shutil.get_terminal_size().columns - 1
        self._stream.write(ERASE + printable_line(text)[:width])
        self._stream.flush()


class ProgressLine(LiveLine):
    """Where a reconstruction stands, photo by photo and in the steps of its end."""

    def __init__(self, stream: TextIO, *, quiet: bool = False) -> None:
        super().__init__(stream, quiet=quiet)
        self._total = 0
        self._started = time.perf_counter()
        self._done = 0
        self._added = 0
        self._placed = 0
        self._points = 0
        self._is_finishing = False
        self._counts = True
        self._said = ""
        self._seconds_a_photo: dict[int, float] = {}
        self._heartbeat = Heartbeat(stream)

    def expect(self, total: int) -> None:
        """Time counts from now, to ``total`` photos."""
        self._total = total
        self._started = time.perf_counter()

    def show(self, event: Event) -> None:
        """Count a photo and show where things stand. Of other events only what can be mended while
        photos come is told; the closing summary has all."""
        if isinstance(event, ControlPointsRefused) and not self._is_finishing:
            self._print(str(event))
        if isinstance(event, ModelRefined):
            self._seconds_a_photo[event.model_id] = event.seconds / max(event.num_registered, 1)
        if isinstance(event, FinishingBegan):
            self._is_finishing = True
            self._write(self._finishing(event), is_long=True)
        if isinstance(event, Skipped):
            self.note(f"skipped {event.name}: {event}")
        elif isinstance(event, PhotoAdded):
            self._placed, self._points = event.num_registered, event.num_points
            self._added += 1
            if self._counts and self._added == _WONDER_AFTER and not self._placed:
                self.note(_NONE_YET)
        else:
            return
        self._done += 1
        if not self._counts:
            return
        # Nobody knows how many are still to come if a folder is watched.
        of = f" of {self._total}" if self._total else ""
        pace = f"  {_pace(self._started, self._done, self._total)}" if self._total else ""
        self._write(
            f"photo {self._done}{of}: {self._placed} placed, {counted(self._points, 'point')}{pace}"
        )

    def say(self, text: str) -> None:
        """In place of the count of photos, from the first call on."""
        self._counts = False
        if text != self._said:
            self._said = text
            self._write(text)

    def _finishing(self, event: FinishingBegan) -> str:
        turn = event.turn
        words = finishing_words(
            event.step.value, event.number, event.num_steps, None if turn is None else asdict(turn)
        )
        seconds_a_photo = self._seconds_a_photo.get(turn.model_id) if turn else None
        if turn is None or seconds_a_photo is None:
            return words
        least, most = (share * seconds_a_photo * turn.num_photos for share in _LAST_ADJUSTMENT)
        return words if most < _WORTH_SAYING_S else f"{words}, usually {_between(least, most)}"

    def step(self, what: str) -> None:
        """A step of the end begins."""
        self._write(f"finishing: {what}", is_long=True)

    def close(self) -> None:
        """What is printed from here on is the last."""
        self._heartbeat.stop()
        self.end()

    def _write(self, text: str, *, is_long: bool = False) -> None:
        super()._write(text)
        if not self._quiet:
            self._heartbeat.say(printable_line(text), is_long=is_long)


class CountLine(LiveLine):
    """How many photos are done; where there is no terminal, a line each tenth."""

    def __init__(self, what: str, stream: TextIO, *, quiet: bool = False) -> None:
        super().__init__(stream, quiet=quiet)
        self._what = what
        self._started = time.perf_counter()

    def show(self, done: int, total: int) -> None:
        """To be called after each photo."""
        tenths_before, tenths = (10 * n // total for n in (done - 1, done))
        if self._live or tenths > tenths_before:
            self._write(f"{self._what} {done} of {total}  {_pace(self._started, done, total)}")


def _pace(started: float, done: int, total: int) -> str:
    seconds = (time.perf_counter() - started) / done
    return f"{seconds:.2f} s a photo  {clock(seconds * (total - done))} left"


def _between(least_s: float, most_s: float) -> str:
    """Half a minute to two, say; in minutes where these say enough."""
    if least_s < _WORTH_SAYING_S:
        return f"up to {clock(most_s)}"
    return f"{clock(least_s)} to {clock(most_s)}"
