"""What is looked at first in a result, each with a light: is it as it should be?"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.residuals import PointRole
from sfm_front.georeference.sidecar import Sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.camera_outcome import CameraOutcome
from sfm_front.reports.run_summary import RunSummary
from sfm_front.reports.words import counted

# As Pix4D's quality report has them.
_REGISTERED = (0.95, 0.65)
_FOCAL_CHANGE = (0.01, 0.05)
_MATCHES = (1000, 100)


class Level(Enum):
    """What a light shows."""

    GOOD = "good"
    FAIR = "fair"
    BAD = "bad"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Light:
    """``name`` of what is judged, its ``value`` in short, and what that means in ``words``.

    ``doubt``: what to beware of, as it may follow "but"; empty if of nothing.
    """

    level: Level
    name: str
    value: str
    words: str
    doubt: str = ""


def photos(summary: RunSummary) -> Light:
    """By those in the largest model."""
    used = len(summary.used)
    largest = summary.models[0].num_registered if summary.models else 0
    share = largest / max(used, 1)
    return Light(
        _above(share, _REGISTERED),
        "Photos in the model",
        f"{share:.0%}",
        f"{largest} of {used} in the largest of {counted(len(summary.models), 'model')}",
    )


def matches(num_matched: Sequence[int], num_pairs: Sequence[int]) -> Light:
    """Of each photo: keypoints with a verified match, and verified pairs."""
    name = "Matches a photo"
    if not num_matched:
        return Light(Level.UNKNOWN, name, "none", "no photo was used")
    median = statistics.median(num_matched)
    pairs = statistics.median(num_pairs)
    return Light(
        _above(median, _MATCHES),
        name,
        f"{median:.0f}",
        f"keypoints with a verified match, median; {pairs:.0f} pairs a photo",
    )


def focal_length(cameras: Sequence[CameraOutcome]) -> Light:
    """How far the cameras of a model ended from what EXIF says; each weighs by its photos."""
    name = "Focal length"
    drifts = [
        (abs(camera.drift), camera.is_determined is True)
        for camera in cameras
        if camera.drift is not None
        for _ in range(camera.num_photos)
    ]
    if not drifts:
        return Light(Level.UNKNOWN, name, "found", "EXIF says none to compare with")
    change = statistics.median(drift for drift, _ in drifts)
    words = "from what EXIF says"
    if len(cameras) > 1:
        words += f", median of {len(cameras)} cameras"
    doubt = ""
    if change < _FOCAL_CHANGE[0]:
        level = Level.GOOD
    elif change <= _FOCAL_CHANGE[1]:
        level = Level.FAIR
    elif all(is_determined for drift, is_determined in drifts if drift > _FOCAL_CHANGE[1]):
        # As of a photo that was cropped, or EXIF that is wrong.
        level, words = Level.FAIR, f"{words}; the photos determine it"
    else:
        level = Level.BAD
        doubt = (
            f"its focal length is {change:.0%} from what EXIF says and not determined by the photos"
        )
    return Light(level, name, f"{100 * change:.1f} %", words, doubt)


def positions(sidecar: Sidecar) -> Light:
    """How a model fits the positions of its photos."""
    name = "Fit to GPS"
    residuals = sidecar.residuals
    if residuals is None or sidecar.state is GeoreferenceState.NONE:
        why = sidecar.reasons[0] if sidecar.reasons else "no position could be used"
        return Light(Level.BAD, name, "none", why, f"positions do not put it into metres ({why})")
    if sidecar.state is not GeoreferenceState.METRIC:
        why = sidecar.reasons[0]
        doubt = f"its place and scale are not sure ({why})"
        return Light(Level.FAIR, name, f"{residuals.median_m:.2g} m", why, doubt)
    sound = not sidecar.reasons and not residuals.outliers
    height = "" if residuals.le90_m is None else f", LE90 {residuals.le90_m:.2g} m"
    wrong = f"; {len(residuals.outliers)} taken for wrong" if residuals.outliers else ""
    return Light(
        Level.GOOD if sound else Level.FAIR,
        name,
        f"{residuals.median_m:.2g} m",
        f"median of {residuals.num_used} positions, CE90 {residuals.ce90_m:.2g} m{height}{wrong}",
        _difference(sidecar),
    )


def _difference(sidecar: Sidecar) -> str:
    """Of a metric model and its positions, in short; empty if there is none."""
    if not sidecar.reasons:
        return ""
    # Where the frame is held although positions no longer fix it, all that speaks against it.
    is_long = ";" in sidecar.reasons[0]
    return "positions no longer fix its place and scale" if is_long else sidecar.reasons[0]


def control_points(report: ControlReport) -> Light:
    """By checkpoints, which the model does not know, if there are any."""
    name = "Control points"
    unused = "its control points could not be used"
    if report.model is None:
        return Light(Level.BAD, name, "not used", report.not_used, unused)
    checked = report.checkpoints is not None and report.checkpoints.count > 0
    accuracy = report.checkpoints if checked else report.control
    if accuracy is None:
        return Light(Level.BAD, name, "not used", "none could be measured", unused)
    inexact = report.sigma_factor is not None and report.sigma_factor > 1
    contrary = report.wrong_marks or report.with_role(PointRole.LEFT_OUT)
    height = "" if accuracy.le90_m is None else f", LE90 {accuracy.le90_m:.3f} m"
    doubt = "it does not fit its control points as well as they claim" if inexact else ""
    return Light(
        Level.FAIR if inexact or contrary else Level.GOOD,
        name,
        "" if accuracy.ce90_m is None else f"{accuracy.ce90_m:.3f} m",
        f"CE90 of {counted(accuracy.count, 'checkpoint' if checked else 'control point')}{height}",
        "some of its control points are marked wrongly" if contrary else doubt,
    )


def consistency(summary: RunSummary) -> Light | None:
    """Whether verified pairs contradict the models; None of reports of earlier versions."""
    audits = [model.audit for model in summary.models if model.audit is not None]
    if not audits:
        return None
    against = sum(audit.num_contradicted for audit in audits)
    pairs = sum(audit.num_pairs for audit in audits)
    doubtful = any(audit.is_doubtful for audit in audits)
    return Light(
        Level.BAD if doubtful else Level.GOOD,
        "Consistency",
        "doubtful" if doubtful else "sound",
        f"{against} of {pairs} verified pairs contradict the poses",
        "some of their matches contradict it, as where two things look alike" if doubtful else "",
    )


def _above(value: float, limits: tuple[float, float]) -> Level:
    if value > limits[0]:
        return Level.GOOD
    return Level.FAIR if value >= limits[1] else Level.BAD
