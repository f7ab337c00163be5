"""How well a model and measured positions agree, as surveyors state it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sfm_front.georeference.alignment import Alignment
from sfm_front.types import Float64Array

# Six coefficients of a quadratic surface, and some to see whether they say anything.
_MIN_HEIGHTS_FOR_BEND = 10


@dataclass(frozen=True, slots=True)
class AxisResiduals:
    """Metres; ``sigma`` is about the mean, ``rms`` about 0."""

    mean: float
    sigma: float
    rms: float


@dataclass(frozen=True, slots=True)
class Outlier:
    """A photo whose position is wrong by so many metres."""

    image_id: int
    metres: float


@dataclass(frozen=True, slots=True)
class Bend:
    """Range of the curved part of the height residuals, and its share of the extent.

    A focal length that is wrong bends flat ground; positions do not follow.
    """

    metres: float
    share_of_extent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualSummary:
    """Residuals (fix less camera) of the ``num_used`` positions that are right, by axis.

    ``up`` and ``le90_m`` are None where no height is known. ``ce90_m`` and ``le90_m``: within these
    metres, in the plane and in height, are nine of ten. ``outliers``: the largest first.
    """

    num_used: int
    east: AxisResiduals
    north: AxisResiduals
    up: AxisResiduals | None
    median_m: float
    ce90_m: float
    le90_m: float | None
    outliers: tuple[Outlier, ...]
    bend: Bend | None


def summarise(
    alignment: Alignment, centres: Float64Array, image_ids: Sequence[int]
) -> ResidualSummary:
    """``centres`` (N, 3) in the model and ``image_ids`` of the photos that were aligned."""
    used = alignment.residuals[alignment.inliers]
    plane = np.linalg.norm(used[:, :2], axis=1)
    heights = np.abs(used[np.isfinite(used[:, 2]), 2])
    # Without a height, what is left is the distance in the plane.
    distances = np.linalg.norm(np.nan_to_num(alignment.residuals), axis=1)
    wrong = np.flatnonzero(~alignment.inliers)
    wrong = wrong[np.argsort(-distances[wrong], kind="stable")]
    enu = alignment.enu_from_model * centres[alignment.inliers]
    return ResidualSummary(
        num_used=alignment.num_inliers,
        east=_by_axis(used[:, 0]),
        north=_by_axis(used[:, 1]),
        up=_by_axis(used[np.isfinite(used[:, 2]), 2]) if len(heights) else None,
        median_m=float(np.median(distances[alignment.inliers])),
        ce90_m=float(np.percentile(plane, 90)),
        le90_m=float(np.percentile(heights, 90)) if len(heights) else None,
        outliers=tuple(Outlier(image_ids[row], float(distances[row])) for row in wrong.tolist()),
        bend=bend_of_heights(enu, used[:, 2]),
    )


def bend_of_heights(enu: Float64Array, heights: Float64Array) -> Bend | None:
    """The curved part of height residuals (N,) in metres at positions (N, 3).

    A quadratic surface less a plane, each the best by least squares; its range is taken over the
    positions, the extent is the diagonal of their box. None for fewer than ten known heights, or if
    it is larger than the extent: then the scale is not known.
    """
    known = np.isfinite(heights)
    if known.sum() < _MIN_HEIGHTS_FOR_BEND:
        return None
    plane = enu[known, :2] - enu[known, :2].mean(axis=0)
    extent = float(np.linalg.norm(np.ptp(plane, axis=0)))
    if extent == 0:
        return None
    east, north = plane.T / extent
    flat = np.column_stack([np.ones_like(east), east, north])
    curved = np.column_stack([flat, east**2, east * north, north**2])
    curved_part = _fitted(curved, heights[known]) - _fitted(flat, heights[known])
    metres = float(np.ptp(curved_part))
    return Bend(metres, metres / extent) if metres <= extent else None


def _fitted(columns: Float64Array, values: Float64Array) -> Float64Array:
    # Positions on a line leave terms open: the smallest ones are taken.
    solution = np.linalg.lstsq(columns, values, rcond=1e-6)[0]
    fitted: Float64Array = columns @ solution
    return fitted


def _by_axis(values: Float64Array) -> AxisResiduals:
    return AxisResiduals(
        float(values.mean()), float(values.std()), float(np.sqrt(np.mean(values**2)))
    )
