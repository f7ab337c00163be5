"""What became of control points, in words for the closing summary."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.residuals import ControlAccuracy, MarkResidual, PointRole

# Of each kind; report.json has all.
_MOST_NAMED = 10


def control_lines(report: ControlReport) -> list[str]:
    """Accuracy, and all that the user should look at again."""
    if report.model is None or report.control is None or report.checkpoints is None:
        return [
            f"control points of {report.file} are not used, the models are as without them: "
            f"{report.not_used}",
            "  mend that and give the same command: it goes on from here",
        ]
    lines = [
        f"control points of {report.file}: {report.control.count} of "
        f"{sum(point.role is not PointRole.CHECKPOINT for point in report.points)} hold "
        f"sparse/{report.model}: {_accuracy(report.control)}"
    ]
    if report.checkpoints.count:
        lines.append(f"  {report.checkpoints.count} checkpoints: {_accuracy(report.checkpoints)}")
    if report.sigma_factor is not None and report.sigma_factor > 1:
        lines.append(
            f"  they are {report.sigma_factor:.0f} times less exact than stated: look at marks and "
            "survey, or give --gcp-accuracy"
        )
    lines += _first([f"  {point}" for point in report.with_role(PointRole.LEFT_OUT)])
    lines += _first(
        [
            f"  {point.name} is not measured: no two photos of the model have marks that agree"
            for point in report.with_role(PointRole.NOT_MEASURED)
        ]
    )
    lines += _first(
        [
            f"  {point.name}: its mark in {mark.photo} is off by {_pixels(mark)}"
            for point, mark in report.wrong_marks
            if point.role is not PointRole.LEFT_OUT  # told above
        ]
    )
    if report.missing_photos:
        names = ", ".join(report.missing_photos[:_MOST_NAMED])
        more = ", …" if len(report.missing_photos) > _MOST_NAMED else ""
        lines.append(f"  marked, but not among the photos: {names}{more}")
    return lines


def _accuracy(accuracy: ControlAccuracy) -> str:
    by_axis = ", ".join(
        f"{axis} {value:.3f}"
        for axis, value in (
            ("east", accuracy.east_rms_m),
            ("north", accuracy.north_rms_m),
            ("up", accuracy.up_rms_m),
        )
        if value is not None
    )
    within = ", ".join(
        f"{name} {value:.3f} m"
        for name, value in (("CE90", accuracy.ce90_m), ("LE90", accuracy.le90_m))
        if value is not None
    )
    return f"RMS {by_axis} m; {within}"


def _pixels(mark: MarkResidual) -> str:
    off = math.hypot(mark.x_px, mark.y_px)
    return "more than can be told" if math.isnan(off) else f"{off:.1f} px"


def _first(lines: Sequence[str]) -> list[str]:
    more = [f"  … and {len(lines) - _MOST_NAMED} more"] if len(lines) > _MOST_NAMED else []
    return [*lines[:_MOST_NAMED], *more]
