"""What the user reads while photos are taken in, and at the end."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from pathlib import Path
from typing import Any, TextIO

from sfm_front.types import StepReport


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

    def __init__(self, total: int, stream: TextIO) -> None:
        super().__init__(stream)
        self._total = total
        self._started = time.perf_counter()
        self._done = 0
        self._registered = 0
        self._points = 0

    def show(self, step: StepReport) -> None:
        """Count a photo and show where things stand."""
        self._done += 1
        if step.skipped is not None:
            self.note(f"skipped {step.name}: {step.skipped}")
        else:
            self._registered, self._points = step.num_registered, step.num_points
        self._write(
            f"photo {self._done}/{self._total}  registered {self._registered}  "
            f"points {self._points}  {_pace(self._started, self._done, self._total)}"
        )

    def finishing(self) -> None:
        self._write("last refinement, then writing the models …")


class CountLine(LiveLine):
    """How many of ``total`` photos are done; where there is no terminal, a line each tenth."""

    def __init__(self, what: str, total: int, stream: TextIO) -> None:
        super().__init__(stream)
        self._what = what
        self._total = total
        self._started = time.perf_counter()
        self._done = 0

    def count(self) -> None:
        """Count a photo and show where things stand."""
        self._done += 1
        tenths_before, tenths = (10 * n // self._total for n in (self._done - 1, self._done))
        if self._live or tenths > tenths_before:
            pace = _pace(self._started, self._done, self._total)
            self._write(f"{self._what} {self._done}/{self._total}  {pace}")


def closing_summary(report: dict[str, Any], output: Path) -> str:
    """The result in words, from the content of ``report.json``."""
    totals = report["totals"]
    lines = [
        f"{totals['registered']} of {totals['photos']} photos registered in "
        f"{_plural(totals['models'], 'model')}, {_clock(totals['wall_seconds'])}"
    ]
    for model in report["models"]:
        lines.append(
            f"  {output / model['path']}: {model['registered']} photos, "
            f"{model['points3D']} points, {model['mean_reprojection_error_px']:.2f} px"
        )
    photos = max(totals["photos"], 1)
    stages = ", ".join(
        f"{stage} {seconds / photos:.3f}" for stage, seconds in totals["seconds_by_stage"].items()
    )
    lines.append(
        f"seconds a photo: {totals['wall_seconds'] / photos:.2f} in all; by stage, "
        f"side by side in part: {stages}"
    )
    by_quarter = totals["median_seconds_by_quarter"]
    if len(by_quarter) == 4:
        lines.append(
            "work on a photo, global refinement apart, median by quarter of the run: "
            + ", ".join(f"{seconds:.2f} s" for seconds in by_quarter)
        )
    lines += _reasons(
        "skipped",
        [
            (row["name"], ": ".join(filter(None, row["skipped"].values())))
            for row in report["photos"]
            if row["skipped"]
        ],
    )
    lines += _reasons(
        "not registered",
        [
            (row["name"], row["why_not_registered"])
            for row in report["photos"]
            if not row["skipped"] and not row["registered"]
        ],
    )
    if not report["models"]:
        lines.append(
            "no model could be built: take photos that overlap by two thirds and more, "
            "from different places"
        )
    return "\n".join(lines)


def _reasons(what: str, rows: list[tuple[str, str]]) -> list[str]:
    """Every file with its reason, or how often each reason came where there are many."""
    if not rows:
        return []
    if len(rows) <= 20:
        return [f"{what}:", *(f"  {name}: {why}" for name, why in rows)]
    counted = Counter(why for _, why in rows).most_common(10)
    return [
        f"{what}: {len(rows)} photos (each in report.json)",
        *(f"  {count} × {why}" for why, count in counted),
    ]


def _pace(started: float, done: int, total: int) -> str:
    seconds = (time.perf_counter() - started) / done
    return f"{seconds:.2f} s a photo  {_clock(seconds * (total - done))} left"


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
