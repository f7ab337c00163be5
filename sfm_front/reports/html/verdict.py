"""Is it any good: one sentence, and a light for each thing that is looked at first."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import Enum

import numpy as np

from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.residuals import PointRole
from sfm_front.georeference.sidecar import Sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.html.cameras import CameraResult, median_change
from sfm_front.reports.html.markup import Html, counted, joined, tag
from sfm_front.reports.html.material import Material

# As Pix4D's quality report has them.
_REGISTERED = (0.95, 0.65)
_FOCAL_CHANGE = (0.01, 0.05)
_MATCHES = (1000, 100)


class Level(Enum):
    """What a light shows; its value names the class of the style sheet."""

    GOOD = "good"
    FAIR = "fair"
    BAD = "bad"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Light:
    """``name`` of what is judged, its ``value`` in short, and what that means in ``words``."""

    level: Level
    name: str
    value: str
    words: str


def sentence(material: Material) -> str:
    """What came out, and why it is no more."""
    summary = material.summary
    used, skipped = len(summary.used), len(summary.skipped)
    files = f" {counted(skipped, 'file')} could not be used." if skipped else ""
    if not summary.models:
        return f"No model could be built from {counted(used, 'photo')}.{files}"
    largest, rest = summary.models[0].num_registered, len(summary.models) - 1
    total = summary.totals.num_registered
    what = "All" if largest == used else f"{largest} of"
    parts = [f"{what} {counted(used, 'photo')} {'is' if used == 1 else 'are'} in one model"]
    if material.frame is not None:
        parts[0] += ", in metres"
    doubtful = sum(bool(m.audit and m.audit.is_doubtful) for m in summary.models)
    if doubtful:
        parts[0] += ", but some of their matches contradict it"
    if rest:
        parts.append(f"{total - largest} more in {counted(rest, 'other')}")
    missing = Counter(photo.why_not or "" for photo in summary.used if photo.model is None)
    if missing:
        why, _ = missing.most_common(1)[0]
        mostly = "" if len(missing) == 1 else "mostly "
        parts.append(f"{missing.total()} in none, {mostly}because: {why}")
    return "; ".join(parts) + "." + files


def lights(material: Material, cameras: list[CameraResult]) -> list[Light]:
    """In order of weight; what nothing is known of is left out, but for focal lengths."""
    found = [_registered(material), _matches(material), _focal(cameras)]
    if material.sidecar is not None:
        control = material.sidecar.control_points
        if material.session.positions or control is None:
            found.append(_positions(material.sidecar))
        if control is not None:
            found.append(_control(control))
    if any(model.audit is not None for model in material.summary.models):
        found.append(_audit(material))
    return found


def as_list(found: list[Light]) -> Html:
    """The lights below each other."""
    return tag(
        "ul",
        joined(
            tag(
                "li",
                tag(
                    "i",
                    class_=f"light {light.level.value}",
                    role="img",
                    aria_label=light.level.value,
                ),
                tag("b", light.name),
                tag("span", light.value, class_="value"),
                tag("small", light.words),
            )
            for light in found
        ),
        class_="lights",
    )


def _registered(material: Material) -> Light:
    summary = material.summary
    used = max(len(summary.used), 1)
    largest = summary.models[0].num_registered if summary.models else 0
    share = largest / used
    return Light(
        _above(share, _REGISTERED),
        "Photos in the model",
        f"{share:.0%}",
        f"{largest} of {len(summary.used)} in the largest of "
        f"{counted(len(summary.models), 'model')}",
    )


def _matches(material: Material) -> Light:
    counts = [
        material.session.num_matched.get(photo.image_id, 0) for photo in material.summary.used
    ]
    if not counts:
        return Light(Level.UNKNOWN, "Matches a photo", "none", "no photo was used")
    median = float(np.median(counts))
    pairs = [material.num_pairs.get(photo.image_id, 0) for photo in material.summary.used]
    return Light(
        _above(median, _MATCHES),
        "Matches a photo",
        f"{median:.0f}",
        f"keypoints with a verified match, median; {np.median(pairs):.0f} pairs a photo",
    )


def _focal(cameras: list[CameraResult]) -> Light:
    change = median_change(cameras)
    if change is None:
        return Light(Level.UNKNOWN, "Focal length", "found", "EXIF says none to compare with")
    level = (
        Level.GOOD
        if change < _FOCAL_CHANGE[0]
        else Level.FAIR
        if change <= _FOCAL_CHANGE[1]
        else Level.BAD
    )
    words = "from what EXIF says"
    if len(cameras) > 1:
        words += f", median of {len(cameras)} cameras"
    return Light(level, "Focal length", f"{100 * change:.1f} %", words)


def _positions(sidecar: Sidecar) -> Light:
    name = "Fit to GPS"
    if sidecar.residuals is None or sidecar.state is GeoreferenceState.NONE:
        why = sidecar.reasons[0] if sidecar.reasons else "no position could be used"
        return Light(Level.BAD, name, "none", why)
    residuals = sidecar.residuals
    metric = sidecar.state is GeoreferenceState.METRIC
    sound = metric and not sidecar.reasons and not residuals.outliers
    height = "" if residuals.le90_m is None else f", LE90 {residuals.le90_m:.2g} m"
    wrong = f"; {len(residuals.outliers)} taken for wrong" if residuals.outliers else ""
    return Light(
        Level.GOOD if sound else Level.FAIR,
        name,
        f"{residuals.median_m:.2g} m",
        f"median of {residuals.num_used} positions, CE90 {residuals.ce90_m:.2g} m{height}{wrong}"
        if metric
        else sidecar.reasons[0],
    )


def _control(report: ControlReport) -> Light:
    """By checkpoints, which the model does not know, if there are any."""
    name = "Control points"
    if report.model is None:
        return Light(Level.BAD, name, "not used", report.not_used)
    checked = report.checkpoints is not None and report.checkpoints.count > 0
    accuracy = report.checkpoints if checked else report.control
    if accuracy is None:
        return Light(Level.BAD, name, "not used", "none could be measured")
    inexact = report.sigma_factor is not None and report.sigma_factor > 1
    sound = not (inexact or report.wrong_marks or report.with_role(PointRole.LEFT_OUT))
    height = "" if accuracy.le90_m is None else f", LE90 {accuracy.le90_m:.3f} m"
    return Light(
        Level.GOOD if sound else Level.FAIR,
        name,
        "" if accuracy.ce90_m is None else f"{accuracy.ce90_m:.3f} m",
        f"CE90 of {counted(accuracy.count, 'checkpoint' if checked else 'control point')}{height}",
    )


def _audit(material: Material) -> Light:
    audits = [model.audit for model in material.summary.models if model.audit is not None]
    against = sum(audit.num_contradicted for audit in audits)
    pairs = sum(audit.num_pairs for audit in audits)
    doubtful = any(audit.is_doubtful for audit in audits)
    return Light(
        Level.BAD if doubtful else Level.GOOD,
        "Consistency",
        "doubtful" if doubtful else "sound",
        f"{against} of {pairs} verified pairs contradict the poses",
    )


def _above(value: float, limits: tuple[float, float]) -> Level:
    if value > limits[0]:
        return Level.GOOD
    return Level.FAIR if value >= limits[1] else Level.BAD
