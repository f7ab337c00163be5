"""Surveyed points against the model: each residual, and how exact control and checkpoints are."""

from __future__ import annotations

from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.residuals import ControlAccuracy, PointResidual, PointRole
from sfm_front.reports.html.markup import Html, joined, table, tag
from sfm_front.reports.words import counted

_STATES = {
    PointRole.CONTROL: "placed",
    PointRole.CHECKPOINT: "placed",
    PointRole.LEFT_OUT: "missing",
    PointRole.NOT_MEASURED: "other",
}


def control_points(report: ControlReport | None) -> Html | None:
    """None where there are none."""
    if report is None:
        return None
    if report.model is None:
        unused = f"The points of {report.file} are not used: {report.not_used}."
        return joined([tag("h3", "Control points"), tag("p", unused)])
    sums = [
        [f"{name}, {counted(accuracy.count, 'point')}", *_sum(accuracy)]
        for name, accuracy in (("control", report.control), ("checkpoints", report.checkpoints))
        if accuracy is not None and accuracy.count
    ]
    missing = ", ".join(report.missing_photos)
    return joined(
        [
            tag("h3", f"Control points of {report.file}"),
            table(("RMS, m", "east", "north", "up", "CE90", "LE90"), sums),
            table(
                ("model less survey, m", "role", "east", "north", "up", "photos", "wrong marks"),
                map(_point, report.points),
                numbers_from=2,
            ),
            tag("p", f"Marked, but not among the photos: {missing}.") if missing else None,
        ]
    )


def _sum(accuracy: ControlAccuracy) -> list[str]:
    return [
        _metres(value)
        for value in (
            accuracy.east_rms_m,
            accuracy.north_rms_m,
            accuracy.up_rms_m,
            accuracy.ce90_m,
            accuracy.le90_m,
        )
    ]


def _point(point: PointResidual) -> list[object]:
    wrong = ", ".join(mark.photo for mark in point.marks if not mark.agrees)
    return [
        point.name,
        tag("span", point.role.value, class_=f"state {_STATES[point.role]}"),
        *(_metres(value) for value in (point.east_m, point.north_m, point.up_m)),
        len(point.marks),
        wrong,
    ]


def _metres(value: float | None) -> str:
    return "" if value is None else f"{round(value, 3) + 0.0:.3f}"
