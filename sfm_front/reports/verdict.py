"""What came out in one sentence, with its likely causes where it is not all that was hoped for.

The closing summary begins with it, and so does the page.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from sfm_front.georeference.sidecar import Sidecar
from sfm_front.reports import lights
from sfm_front.reports.lights import Level, Light
from sfm_front.reports.run_summary import PhotoOutcome, RunSummary
from sfm_front.reports.words import counted
from sfm_front.types import WaitingReason

_CAUSES = {
    WaitingReason.NO_MATCHES: "{they_share} too little with any other photo",
    WaitingReason.NEIGHBORS_WAIT: "{they_share} something only with others of these",
    WaitingReason.NO_POSE: "{they_share} too little with the photos in the model",
}
# Photos that found no place may be blurred or bare if they have less than this share of the
# keypoints of the others. It decides nothing but the wording.
_POOR = 0.25


@dataclass(frozen=True, slots=True)
class Verdict:
    """How good a result is, and that in a ``sentence``; ``level`` is never unknown."""

    level: Level
    sentence: str


def verdict(summary: RunSummary, sidecar: Sidecar | None) -> Verdict:
    """``sidecar``: where the models stand on the earth; None if there are no positions."""
    if not summary.models:
        return Verdict(Level.BAD, f"No model could be built{_why_no_model(summary)}.")
    registered, consistency = lights.photos(summary), lights.consistency(summary)
    doubts = [light.doubt for light in judged(summary, sidecar) if light.doubt]
    # One doubt may be EXIF's or the receiver's fault, two hardly.
    if Level.BAD in (registered.level, consistency and consistency.level) or len(doubts) > 1:
        level = Level.BAD
    elif doubts:
        level = Level.FAIR
    else:
        level = registered.level
    parts = (
        _placed(summary, sidecar, doubts),
        _elsewhere(summary),
        _missing(summary),
        _skipped(summary),
    )
    return Verdict(level, "; ".join(filter(None, parts)) + ".")


def judged(summary: RunSummary, sidecar: Sidecar | None) -> list[Light]:
    """All lights but that of matches, which takes the database: in order of weight."""
    cameras = summary.cameras
    if summary.models:
        cameras = tuple(one for one in cameras if one.model_path == summary.models[0].path)
    found = [lights.photos(summary), lights.focal_length(cameras)]
    if sidecar is not None:
        control = sidecar.control_points
        if control is None or sidecar.residuals is not None or sidecar.left_out:
            found.append(lights.positions(sidecar))
        if control is not None:
            found.append(lights.control_points(control))
    consistency = lights.consistency(summary)
    return found if consistency is None else [*found, consistency]


def _placed(summary: RunSummary, sidecar: Sidecar | None, doubts: Sequence[str]) -> str:
    used, largest = len(summary.used), summary.models[0].num_registered
    if largest == used:
        words = f"All {used} photos are in one model"
    else:
        only = "Only " if lights.photos(summary).level is Level.BAD else ""
        words = f"{only}{largest} of {used} photos are in one model"
    if sidecar is not None and 0 in sidecar.models_in_enu:
        words += ", in metres"
    if doubts:
        words += f", but {', and '.join(doubts)}"
    return words


def _elsewhere(summary: RunSummary) -> str:
    """Photos of smaller models."""
    more = summary.totals.num_registered - summary.models[0].num_registered
    others = len(summary.models) - 1
    if not others:
        return ""
    which = "another one" if others == 1 else f"{others} others"
    return f"{more} more in {which}, which too few matches link to it"


def _missing(summary: RunSummary) -> str:
    missing = [photo for photo in summary.used if photo.model is None]
    if not missing:
        return ""
    # A poor photo has no matches because it is poor.
    causes = [_cause(photo) for photo in missing]
    if _are_poor(missing, summary):
        causes = ["{they_share} few details with any photo, as if blurred or bare"]
    cause, count = Counter(causes).most_common(1)[0]
    mostly = "mostly " if count < len(missing) else ""
    why = cause.format(they_share="they share" if len(missing) > 1 else "it shares")
    return f"{len(missing)} found no place, {mostly}because {why}"


def _cause(photo: PhotoOutcome) -> str:
    if photo.waiting is not None:
        return _CAUSES[photo.waiting]
    why = photo.why_not or ""
    return "of this: " + why.replace("{", "{{").replace("}", "}}")


def _are_poor(missing: list[PhotoOutcome], summary: RunSummary) -> bool:
    placed = [photo.num_keypoints for photo in summary.used if photo.model is not None]
    if not placed:
        return False
    poor = statistics.median(photo.num_keypoints for photo in missing)
    return poor < _POOR * statistics.median(placed)


def _why_no_model(summary: RunSummary) -> str:
    """And what to do, as far as that can be told."""
    if not summary.photos:
        return ": no photo came"
    if not summary.used:
        return f": no photo could be read; {_skipped(summary)}"
    of = f" from {counted(len(summary.used), 'photo')}"
    skipped = f"; {files}" if (files := _skipped(summary)) else ""
    if len(summary.used) == 1:
        return f"{of}: it takes at least two that overlap{skipped}"
    # Each but the first can have pairs with earlier photos.
    if 2 * sum(photo.num_verified > 0 for photo in summary.used) >= len(summary.used):
        return (
            f"{of}: they overlap, but the camera hardly moved between them. Take each from "
            f"another place; turning on the spot shows no depth{skipped}"
        )
    return (
        f"{of}: they overlap too little. Take photos that overlap by two thirds and more, "
        f"from different places{skipped}"
    )


def _skipped(summary: RunSummary) -> str:
    """Files that were skipped."""
    files = summary.skipped
    if not files:
        return ""
    reasons = Counter(photo.reason.value for photo in files)
    reason, count = reasons.most_common(1)[0]
    if count == len(files):
        why = reason
    elif 2 * count > len(files):
        why = f"mostly {reason}"
    else:
        why = ", ".join(reason for reason, _ in reasons.most_common())
    verb = "was" if len(files) == 1 else "were"
    return f"{counted(len(files), 'file')} {verb} skipped ({why})"
