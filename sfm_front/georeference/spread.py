"""What positions fix of a model, and in what words it is said."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from sfm_front.errors import ConfigError
from sfm_front.georeference.alignment import MIN_POSITIONS, Alignment
from sfm_front.georeference.fixes import Fixes
from sfm_front.types import Float64Array

# How near to the line of the photos the axis of the loosest rotation lies for being that line, and
# how much looser than the others it is.
_LINE_COSINE = 0.9
_LINE_TIMES = 2.0
# So many claimed standard deviations are worth a word.
_DIFFERENT = 2.0


class GeoreferenceState(Enum):
    """How far a model's frame is that of the earth."""

    NONE = "none"
    PROVISIONAL = "provisional"
    METRIC = "metric"


@dataclass(frozen=True, kw_only=True)
class SpreadOptions:
    """From when on a frame counts as metric. How exact it is then stands beside it and improves:
    these are such that it will not turn over any more."""

    # Three fit any similarity well; with five, two may be wrong and it shows.
    min_positions: int = 5
    # Standard deviations: share of the scale, and of the rotation about its loosest axis.
    max_scale_sigma: float = 0.25
    max_rotation_sigma_deg: float = 12.0

    def __post_init__(self) -> None:
        if self.min_positions < MIN_POSITIONS:
            raise ConfigError(
                f"min_positions must be at least {MIN_POSITIONS}, got {self.min_positions}"
            )
        for name in ("max_scale_sigma", "max_rotation_sigma_deg"):
            if getattr(self, name) <= 0:
                raise ConfigError(f"{name} must be above 0, got {getattr(self, name)}")


@dataclass(frozen=True, slots=True)
class Verdict:
    """A state, and why it is no better; of a metric one, what it rests on beside positions. Then,
    where model and positions differ by more than these claim."""

    state: GeoreferenceState
    reasons: tuple[str, ...] = ()


def judge(alignment: Alignment | None, fixes: Fixes, options: SpreadOptions) -> Verdict:
    """What an alignment to these fixes is good for."""
    if alignment is None:
        few = f"{_positions(len(fixes))}, {MIN_POSITIONS} are needed"
        contrary = "the positions coincide, or no three of them agree with the model"
        reason = few if len(fixes) < MIN_POSITIONS else contrary
        return Verdict(GeoreferenceState.NONE, (reason,))
    reasons = []
    if alignment.num_inliers < options.min_positions:
        reasons.append(
            f"{_positions(alignment.num_inliers)} that agree, {options.min_positions} are needed"
        )
    if not fixes.known[alignment.inliers, 2].any():
        reasons.append("no height is known")
    loosest_deg = _loosest_deg(alignment.covariance)
    line = _line(alignment, fixes)
    if loosest_deg > options.max_rotation_sigma_deg:
        rotation = "the rotation about it is" if line else "the rotation is"
        where = "the photos lie on a line: " if line else ""
        reasons.append(f"{where}{rotation} not fixed (± {loosest_deg:.0f}°)")
    if alignment.scale_sigma > options.max_scale_sigma:
        extent_m, error_m = _extent_and_error(alignment, fixes)
        reasons.append(
            f"the scale is uncertain by {100 * alignment.scale_sigma:.0f} %: "
            f"positions within {extent_m:.0f} m that are off by {error_m:.1f} m"
        )
    state = GeoreferenceState.PROVISIONAL if reasons else GeoreferenceState.METRIC
    by_position_deg = _loosest_deg(alignment.positions_only)
    if not reasons and by_position_deg > options.max_rotation_sigma_deg:
        what = "the photos lie on a line: the rotation about it" if line else "the rotation"
        reasons.append(f"{what} is that of cameras held level (± {loosest_deg:.0f}°)")
    return Verdict(state, (*reasons, *_differences(alignment, fixes)))


def _differences(alignment: Alignment, fixes: Fixes) -> list[str]:
    """Where positions and model differ by more than the positions claim."""
    said = []
    for axes, where in ((slice(0, 2), "in the plane"), (slice(2, 3), "in height")):
        known = fixes.known[alignment.inliers, axes]
        residuals = alignment.residuals[alignment.inliers, axes][known]
        sigmas = fixes.sigmas[alignment.inliers, axes][known]
        if known.any() and np.mean((residuals / sigmas) ** 2) > _DIFFERENT**2:
            rms, claimed = np.sqrt(np.mean(residuals**2)), np.median(sigmas)
            said.append(
                f"model and positions differ by {rms:.2g} m {where}, "
                f"where positions claim {claimed:.2g} m"
            )
    return said


def _loosest_deg(covariance: Float64Array) -> float:
    return float(np.degrees(np.sqrt(np.linalg.eigvalsh(covariance[1:4, 1:4])[-1])))


def _line(alignment: Alignment, fixes: Fixes) -> bool:
    """Whether the positions alone leave one rotation open, about the line on which they lie."""
    variances, axes = np.linalg.eigh(alignment.positions_only[1:4, 1:4])
    enu = (fixes.enu - np.nan_to_num(alignment.residuals))[alignment.inliers]
    line = np.linalg.svd(enu - enu.mean(axis=0), full_matrices=False)[2][0]
    loose = np.sqrt(variances[2]) > _LINE_TIMES * np.sqrt(variances[1])
    return bool(loose and abs(axes[:, 2] @ line) > _LINE_COSINE)


def _extent_and_error(alignment: Alignment, fixes: Fixes) -> tuple[float, float]:
    """Metres: diagonal of the box of the cameras, and median distance of cameras and fixes."""
    residuals = np.nan_to_num(alignment.residuals)[alignment.inliers]
    moved = fixes.enu[alignment.inliers] - residuals
    extent = float(np.linalg.norm(np.ptp(moved, axis=0)))
    return extent, float(np.median(np.linalg.norm(residuals, axis=1)))


def _positions(count: int) -> str:
    return f"{count} position" if count == 1 else f"{count} positions"
