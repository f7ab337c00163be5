"""Streams of several lengths side by side, and what more photos would take by a fit to them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from sfm_front.errors import InputError
from sfm_front.evaluation.power_law import PowerLaw
from sfm_front.evaluation.reconstruction.stream import Memory, PhotoCost, StreamResult

# Photos whose cost is what late ones are compared with, in a stream of so many, and how many are
# late.
_EARLY = slice(400, 500)
_NUM_LATE = 100
# The first photos have fewer candidates than the others.
_FIT_FROM = 100


@dataclass(frozen=True, slots=True)
class Scale:
    """What a stream of ``num_photos`` took.

    Processor seconds of a photo with global refinement, each spread over the photos since the one
    before: ``early_seconds`` of photos 400 to 500 (of a shorter stream, those in its middle),
    ``late_seconds`` of the last 100.
    ``refinement_share``: of all processor seconds while photos came, those of global refinement.
    ``retrieval_seconds``: median wall seconds of a query among those. ``finish_seconds``:
    processor seconds of the end. ``stream_bytes`` and ``peak_bytes``: the most memory while photos
    came, and at all, the synthetic flight included; None on systems that do not tell. ``auc``: at
    1 degree, in [0, 1].
    """

    num_photos: int
    num_registered: int
    early_seconds: float
    late_seconds: float
    refinement_share: float
    retrieval_seconds: float
    finish_seconds: float
    stream_bytes: int | None
    peak_bytes: int | None
    auc: float

    @classmethod
    def of(cls, result: StreamResult) -> Scale:
        photos, seconds = result.photos, result.amortized_processor_seconds()
        refinement = result.beside_processor_seconds + sum(
            photo.refinement_processor_seconds for photo in photos
        )
        early = _EARLY if len(photos) >= _EARLY.stop else slice(len(photos) // 2, None)
        # What runs beside the session is refinement that no photo's own seconds have.
        beside = result.beside_processor_seconds
        all_seconds = beside + sum(photo.processor_seconds for photo in photos)
        return cls(
            num_photos=len(photos),
            num_registered=result.num_registered,
            early_seconds=float(np.mean(seconds[early])),
            late_seconds=float(np.mean(seconds[-_NUM_LATE:])),
            refinement_share=refinement / all_seconds,
            retrieval_seconds=float(
                np.median([photo.retrieval_seconds for photo in photos[-_NUM_LATE:]])
            ),
            finish_seconds=result.finish_processor_seconds,
            stream_bytes=result.peak_in_stream,
            peak_bytes=result.memory.peak,
            auc=result.auc[0],
        )

    @property
    def growth(self) -> float:
        """Processor seconds of a late photo over those of an early one."""
        return self.late_seconds / self.early_seconds


@dataclass(frozen=True, slots=True)
class Line:
    """``start`` and ``per_photo`` of each photo, by least squares."""

    start: float
    per_photo: float

    @classmethod
    def through(cls, numbers: Sequence[float], values: Sequence[float]) -> Line:
        slope, start = np.polyfit(numbers, values, 1)
        return cls(float(start), float(slope))

    def at(self, number: float) -> float:
        return self.start + self.per_photo * number


@dataclass(frozen=True, slots=True)
class Fit:
    """What streams of several lengths say of longer ones.

    ``stream_seconds``: processor seconds of all photos up to one, as a power of its number, from
    the longest stream. ``finish_seconds``: those of the end, as a power of the photos.
    ``peak_bytes``: the most memory, a line; None where it is not known.
    """

    stream_seconds: PowerLaw
    finish_seconds: PowerLaw
    peak_bytes: Line | None

    @classmethod
    def to(cls, results: Sequence[StreamResult]) -> Fit:
        """At least two streams, of different lengths."""
        longest = max(results, key=lambda result: len(result.photos))
        total = np.cumsum(longest.amortized_processor_seconds())
        numbers = np.arange(1.0, len(total) + 1)
        lengths = [len(result.photos) for result in results]
        peaks = [result.memory.peak for result in results]
        known = [peak for peak in peaks if peak is not None]
        return cls(
            PowerLaw.through(numbers[_FIT_FROM:], total[_FIT_FROM:]),
            PowerLaw.through(lengths, [r.finish_processor_seconds for r in results]),
            Line.through(lengths, known) if len(known) == len(peaks) else None,
        )

    def photo_seconds(self, number: float) -> float:
        """Processor seconds of one photo, refinement included: the slope of those of all."""
        return self.stream_seconds.exponent * self.stream_seconds.at(number) / number


def read_result(file: Path) -> StreamResult:
    """What ``benchmark_stream.py --json`` has written. Raises InputError if it is not that."""
    try:
        content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        known = {field.name for field in fields(StreamResult)}
        values = {name: value for name, value in content.items() if name in known}
        values["photos"] = tuple(PhotoCost(**photo) for photo in content["photos"])
        values["memory"] = Memory(**content["memory"])
        values["auc"] = tuple(content["auc"])
        return StreamResult(**values)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{file}: is not what benchmark_stream.py --json writes") from error


def format_scale(results: Sequence[StreamResult], number: int) -> str:
    """A line for each stream, and what a fit to them says of ``number`` photos."""
    results = sorted(results, key=lambda result: len(result.photos))
    scales = [Scale.of(result) for result in results]
    lines = [
        "photos  registered  CPU s at 400-500  at the end  ratio  refinement  retrieval ms"
        "  end CPU s  memory MiB  peak MiB  AUC at 1°"
    ]
    lines += [
        f"{s.num_photos:<8}{s.num_registered:>10}{s.early_seconds:>18.3f}{s.late_seconds:>12.3f}"
        f"{s.growth:>7.2f}{s.refinement_share:>12.1%}{1e3 * s.retrieval_seconds:>14.1f}"
        f"{s.finish_seconds:>11.0f}{_mib(s.stream_bytes):>12}{_mib(s.peak_bytes):>10}"
        f"{100 * s.auc:>11.1f}"
        for s in scales
    ]
    if len({s.num_photos for s in scales}) > 1:
        lines += _fit_lines(Fit.to(results), number)
    return "\n".join(lines)


def _fit_lines(fit: Fit, number: int) -> list[str]:
    stream, finish, peak = fit.stream_seconds, fit.finish_seconds, fit.peak_bytes
    lines = [
        f"fit: n photos take {stream.factor:.3g} n^{stream.exponent:.3f} CPU s while they come: "
        f"{stream.at(number):.0f} s for {number}, {fit.photo_seconds(number):.3f} s for the last",
        f"fit: the end takes {finish.factor:.3g} n^{finish.exponent:.3f} CPU s: "
        f"{finish.at(number):.0f} s for {number}",
    ]
    if peak is not None:
        lines.append(
            f"fit: memory is at most {_mib(peak.start)} + {peak.per_photo / 2**20:.3f} n MiB: "
            f"{_mib(peak.at(number))} MiB for {number}"
        )
    return lines


def _mib(num_bytes: float | None) -> str:
    return "-" if num_bytes is None else f"{num_bytes / 2**20:.0f}"
