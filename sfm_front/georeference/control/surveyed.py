"""Surveyed points as a model is held to them: in metres, without gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.georeference.control.options import ControlOptions
from sfm_front.georeference.control.point_file import ControlPoint
from sfm_front.types import Float64Array

# What an unknown height may be off, as a share of the extent, where nothing else levels the model.
_FLATNESS = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Surveyed:
    """N points in metres east, north and up.

    ``enu`` (N, 3) without gaps; ``sigmas`` (N, 3) standard deviations; ``has_height`` (N,): where
    it is not known, ``enu`` and ``sigmas`` hold an assumption.
    """

    enu: Float64Array
    sigmas: Float64Array
    has_height: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.enu)

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Surveyed:
        return Surveyed(self.enu[chosen], self.sigmas[chosen], self.has_height[chosen])

    def assume(self, heights: Float64Array, sigma_m: float) -> None:
        """Take these (N,) for the heights that are not known, except where they are nan."""
        unknown = ~self.has_height & np.isfinite(heights)
        self.enu[unknown, 2] = heights[unknown]
        self.sigmas[unknown, 2] = sigma_m

    def sigmas_of(self, index: int, factor: float) -> Float64Array:
        """(3,) those stated times the factor, and those of assumed heights as they are."""
        factors = np.array([factor, factor, factor if self.has_height[index] else 1.0])
        sigmas: Float64Array = factors * self.sigmas[index]
        return sigmas


def frame_at(points: Sequence[ControlPoint]) -> LocalFrame:
    """At the first point, and the first height that is known, else at 0: the same whenever the
    same file is read."""
    first = points[0].position
    known = (p.position.altitude_m for p in points if p.position.altitude_m is not None)
    return LocalFrame(first.latitude_deg, first.longitude_deg, next(known, 0.0))


def surveyed_in(
    points: Sequence[ControlPoint], frame: LocalFrame, options: ControlOptions
) -> Surveyed:
    """In the frame; unknown heights are the mean of the others, or the frame's 0."""
    places = lat_lon_alt(point.position for point in points)
    has_height = np.isfinite(places[:, 2])
    level = places[has_height, 2].mean() if has_height.any() else frame.altitude_m
    places[~has_height, 2] = level
    enu = frame.to_enu(places)
    extent = float(np.linalg.norm(np.ptp(enu[:, :2], axis=0)))
    sigmas = np.array(
        [
            (
                point.position.horizontal_sigma_m or options.horizontal_sigma_m,
                point.position.horizontal_sigma_m or options.horizontal_sigma_m,
                (point.position.vertical_sigma_m or options.vertical_sigma_m)
                if known
                else _FLATNESS * extent,
            )
            for point, known in zip(points, has_height, strict=True)
        ]
    )
    return Surveyed(enu, sigmas, has_height)
