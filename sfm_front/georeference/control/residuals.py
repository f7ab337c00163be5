"""How far points of a model are from where they were surveyed, in metres and in pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # Reports hold these residuals, and load nothing heavy.
    from sfm_front.georeference.control.marks import PhotoMark
    from sfm_front.georeference.control.point_file import ControlPoint
    from sfm_front.georeference.control.triangulation import MarkedPlace
    from sfm_front.types import Float64Array


class PointRole(Enum):
    """What became of a point."""

    CONTROL = "control"
    CHECKPOINT = "checkpoint"
    LEFT_OUT = "left out"
    NOT_MEASURED = "not measured"


@dataclass(frozen=True, slots=True)
class MarkResidual:
    """Mark minus projection, nan where the point is not measured; ``agrees`` with the others."""

    photo: str
    x_px: float
    y_px: float
    agrees: bool


@dataclass(frozen=True, slots=True)
class PointResidual:
    """What the model says of a point, by its marks alone, less what the survey says, in metres.

    ``up_m`` is None without a surveyed height; all are if the point is not measured: fewer than
    two photos of the model have marks of it that agree.
    """

    name: str
    role: PointRole
    east_m: float | None
    north_m: float | None
    up_m: float | None
    marks: tuple[MarkResidual, ...]

    @property
    def horizontal_m(self) -> float | None:
        if self.east_m is None or self.north_m is None:
            return None
        return float(np.hypot(self.east_m, self.north_m))

    def __str__(self) -> str:
        wrong = ", ".join(
            f"mark in {mark.photo} off by {np.hypot(mark.x_px, mark.y_px):.1f} px"
            for mark in self.marks
            if not mark.agrees and np.isfinite(mark.x_px)
        )
        metres = ", ".join(
            f"{axis} {value:+.3f} m"
            for axis, value in (("east", self.east_m), ("north", self.north_m), ("up", self.up_m))
            if value is not None
        )
        return "; ".join(filter(None, [f"{self.name} ({self.role.value})", metres, wrong]))


@dataclass(frozen=True, slots=True)
class ControlAccuracy:
    """Over ``count`` points: root mean squares in metres, and what 90 % of the errors stay within,
    horizontally (CE90) and in height (LE90); None where no point says."""

    count: int
    east_rms_m: float | None
    north_rms_m: float | None
    up_rms_m: float | None
    ce90_m: float | None
    le90_m: float | None


def residual_of(
    point: ControlPoint,
    marks: Sequence[PhotoMark],
    place: MarkedPlace | None,
    enu: Float64Array,
    role: PointRole,
) -> PointResidual:
    """``marks`` in photos of the model, ``place`` where they meet, ``enu`` (3,) surveyed; ``role``:
    what becomes of the point if they meet, where it is no checkpoint."""
    if place is None:
        nowhere = tuple(MarkResidual(mark.photo, np.nan, np.nan, False) for mark in marks)
        return PointResidual(point.name, PointRole.NOT_MEASURED, None, None, None, nowhere)
    east, north, up = (place.xyz - enu).tolist()
    return PointResidual(
        point.name,
        PointRole.CHECKPOINT if point.is_checkpoint else role,
        east,
        north,
        None if point.position.altitude_m is None else up,
        tuple(
            MarkResidual(mark.photo, float(x), float(y), bool(agrees))
            for mark, (x, y), agrees in zip(marks, place.residuals_px, place.agree, strict=True)
        ),
    )


def accuracy_of(residuals: Sequence[PointResidual], role: PointRole) -> ControlAccuracy:
    """Of the points of one role."""
    chosen = [r for r in residuals if r.role is role]
    east = [r.east_m for r in chosen if r.east_m is not None]
    north = [r.north_m for r in chosen if r.north_m is not None]
    up = [r.up_m for r in chosen if r.up_m is not None]
    return ControlAccuracy(
        count=len(chosen),
        east_rms_m=_rms(east),
        north_rms_m=_rms(north),
        up_rms_m=_rms(up),
        ce90_m=_within_90(np.hypot(east, north)),
        le90_m=_within_90(np.abs(up)),
    )


def _rms(values: Sequence[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _within_90(errors: Float64Array) -> float | None:
    return float(np.percentile(errors, 90)) if len(errors) else None
