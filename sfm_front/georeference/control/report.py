"""What became of a file of control points, and that as JSON: README.md of georeference has it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from sfm_front.georeference.control.residuals import (
    ControlAccuracy,
    MarkResidual,
    PointResidual,
    PointRole,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlReport:
    """``model``: number of the one that the points hold; None if they hold none, and ``not_used``
    says why. ``missing_photos`` have marks in the file, but are not in the session.

    The rest is as in ``ControlResult``.
    """

    file: str
    model: int | None = None
    not_used: str = ""
    missing_photos: tuple[str, ...] = ()
    points: tuple[PointResidual, ...] = ()
    control: ControlAccuracy | None = None
    checkpoints: ControlAccuracy | None = None
    sigma_factor: float | None = None
    error_before_px: float | None = None
    error_after_px: float | None = None

    def with_role(self, role: PointRole) -> list[PointResidual]:
        """The points that have it, in the order of the file."""
        return [point for point in self.points if point.role is role]

    @property
    def wrong_marks(self) -> list[tuple[PointResidual, MarkResidual]]:
        """Each with its point, whose other marks agree on another place."""
        return [
            (point, mark)
            for point in self.points
            if point.role is not PointRole.NOT_MEASURED
            for mark in point.marks
            if not mark.agrees
        ]

    def as_json(self) -> dict[str, Any]:
        """Read by ``of_json``."""
        return {
            "file": self.file,
            "model": self.model,
            "not_used": self.not_used or None,
            "missing_photos": list(self.missing_photos),
            "control": self.control and asdict(self.control),
            "checkpoints": self.checkpoints and asdict(self.checkpoints),
            "sigma_factor": self.sigma_factor,
            "error_px": {"before": self.error_before_px, "after": self.error_after_px},
            "points": [_point_row(point) for point in self.points],
        }

    @classmethod
    def of_json(cls, row: Mapping[str, Any]) -> ControlReport:
        """Back from ``as_json``. Raises KeyError, TypeError or ValueError for anything else."""
        control, checkpoints = row["control"], row["checkpoints"]
        return cls(
            file=row["file"],
            model=row["model"],
            not_used=row["not_used"] or "",
            missing_photos=tuple(row["missing_photos"]),
            control=control and ControlAccuracy(**control),
            checkpoints=checkpoints and ControlAccuracy(**checkpoints),
            sigma_factor=row["sigma_factor"],
            error_before_px=row["error_px"]["before"],
            error_after_px=row["error_px"]["after"],
            points=tuple(_point_of(point) for point in row["points"]),
        )


def _point_row(point: PointResidual) -> dict[str, Any]:
    marks = [
        {
            "photo": mark.photo,
            "x_px": None if math.isnan(mark.x_px) else mark.x_px,
            "y_px": None if math.isnan(mark.y_px) else mark.y_px,
            "agrees": mark.agrees,
        }
        for mark in point.marks
    ]
    return {
        "name": point.name,
        "role": point.role.value,
        "east_m": point.east_m,
        "north_m": point.north_m,
        "up_m": point.up_m,
        "marks": marks,
    }


def _point_of(row: Mapping[str, Any]) -> PointResidual:
    marks = tuple(
        MarkResidual(
            mark["photo"],
            math.nan if mark["x_px"] is None else mark["x_px"],
            math.nan if mark["y_px"] is None else mark["y_px"],
            mark["agrees"],
        )
        for mark in row["marks"]
    )
    role = PointRole(row["role"])
    return PointResidual(row["name"], role, row["east_m"], row["north_m"], row["up_m"], marks)
