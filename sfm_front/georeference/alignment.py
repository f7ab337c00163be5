"""A model against measured positions: the similarity into ENU, and how exact it is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pycolmap

from sfm_front.georeference.consensus import (
    SHARED,
    Floor,
    agreeing,
    find_consensus,
    likeliest_floor,
)
from sfm_front.georeference.drift import drifting_information
from sfm_front.georeference.fitting import NUM_PARAMETERS, Fit, change_of_points, fit
from sfm_front.georeference.fixes import BoolArray, Fixes
from sfm_front.georeference.flights import flight_height_offsets
from sfm_front.georeference.levelling import LevelCameras
from sfm_front.types import Float64Array

MIN_POSITIONS = 3
"""Below, no similarity is determined."""

# Rounds of choosing the fixes that are right and fitting to them.
_MAX_ROUNDS = 4
# Points are distinct to this many metres, or units of the model.
_DISTINCT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """``enu_from_model`` and what speaks for it.

    ``inliers`` (N,): the fixes that are right. ``residuals`` (N, 3): fix less camera in metres,
    flight offsets taken off, nan where the height is not known. ``floor``: by how much right fixes
    are off beyond their standard deviations. ``height_offsets``: metres by which the heights of
    flights are above those of the others; empty where there is no evidence for that.

    ``covariance`` (7, 7): of the logarithm of the scale, a rotation vector (radians, ENU) and a
    shift (metres), all after ``enu_from_model`` and round ``pivot`` (3,) in ENU. It allows for
    errors that drift. ``positions_only`` is the same without the evidence that cameras are held
    level.
    """

    enu_from_model: pycolmap.Sim3d
    inliers: BoolArray
    residuals: Float64Array
    floor: Floor
    pivot: Float64Array
    covariance: Float64Array
    positions_only: Float64Array
    height_offsets: dict[int, float] = field(default_factory=dict)

    @property
    def num_inliers(self) -> int:
        """Fixes that are right."""
        return int(self.inliers.sum())

    @property
    def scale_sigma(self) -> float:
        """Standard deviation of the scale, as a share of it."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def tilt_sigma_deg(self) -> float:
        """Standard deviation of the way up, in the direction in which it is largest."""
        return float(np.degrees(np.sqrt(np.linalg.eigvalsh(self.covariance[1:3, 1:3])[-1])))

    @property
    def heading_sigma_deg(self) -> float:
        """Standard deviation of north."""
        return float(np.degrees(np.sqrt(self.covariance[3, 3])))

    def position_sigmas_m(self, points: Float64Array) -> Float64Array:
        """(M, 3) standard deviations east, north and up of points of the model (M, 3), so far as
        they follow from the alignment."""
        return point_sigmas_m(self.enu_from_model * points - self.pivot, self.covariance)


def point_sigmas_m(arms: Float64Array, covariance: Float64Array) -> Float64Array:
    """(M, 3) of points in ENU, ``arms`` (M, 3) away from the pivot of a covariance."""
    change = change_of_points(arms)
    sigmas: Float64Array = np.sqrt(np.einsum("map,pq,maq->ma", change, covariance, change))
    return sigmas


def align(
    centres: Float64Array,
    fixes: Fixes,
    cam_from_model: Float64Array | None = None,
    seed: int = 0,
) -> Alignment | None:
    """A similarity from camera centres (N, 3) in a model to their fixes; None where there is none.

    ``cam_from_model`` (N, 3, 3): rotations of the cameras as they were held, turned by EXIF's
    orientation. Where they agree on a horizon it counts as one more observation: it tells the
    rotation about the line on which all photos of a strip or a street lie.
    """
    if min(_num_places(fixes.enu[:, :2]), _num_places(centres)) < MIN_POSITIONS:
        return None
    level = None if cam_from_model is None else LevelCameras(cam_from_model)
    similarity, floor = find_consensus(centres, fixes, level, seed)
    inliers = agreeing(similarity, centres, fixes, floor)
    starts = [similarity]
    if level is not None:
        # What positions on a line leave open may be anything in a hypothesis.
        starts.append(level.turned_upright(similarity, centres[inliers]))
    for _ in range(_MAX_ROUNDS):
        if _num_places(fixes.enu[inliers, :2]) < MIN_POSITIONS:
            return None
        fitted_to = inliers
        no_offsets = np.zeros((int(inliers.sum()), 0))
        fits = [
            fit(start, centres[inliers], fixes[inliers], floor, level, no_offsets)
            for start in starts
        ]
        best = min(fits, key=lambda one: one.cost)
        starts = [best.similarity]
        floor = likeliest_floor(best.similarity, centres, fixes)
        inliers = agreeing(best.similarity, centres, fixes, floor)
        if (fitted_to == inliers).all():
            break
    by_flight = flight_height_offsets(best.similarity, centres, fixes, floor, level)
    if by_flight is None:
        return _alignment(best, centres, fixes, floor, fitted_to, {})
    raised = fixes.raised(by_flight.offsets)
    floor = likeliest_floor(by_flight.fit.similarity, centres, raised)
    return _alignment(by_flight.fit, centres, raised, floor, by_flight.inliers, by_flight.offsets)


def _num_places(points: Float64Array) -> int:
    """How many of the points (N, D) differ. Of positions, in the plane: receivers that stand still
    go on counting heights."""
    return len(np.unique(np.round(points / _DISTINCT), axis=0))


def _alignment(
    best: Fit,
    centres: Float64Array,
    fixes: Fixes,
    floor: Floor,
    inliers: BoolArray,
    offsets: dict[int, float],
) -> Alignment:
    residuals = np.where(fixes.known, fixes.enu - best.similarity(centres)[0], np.nan)
    known = fixes.known[inliers]
    claimed = np.mean(floor.variances(fixes[inliers])[known] / best.sigmas[known] ** 2)
    spread = drifting_information(
        best.design, best.residuals / best.sigmas, best.vague, float(claimed)
    )
    flat = best.design.reshape(-1, best.design.shape[2])
    positions = flat.T @ flat / SHARED
    return Alignment(
        enu_from_model=best.similarity.only(),
        inliers=inliers,
        residuals=residuals,
        floor=floor,
        pivot=best.pivot,
        covariance=_sandwich(positions, spread / SHARED**2, best.level + best.vague),
        positions_only=_sandwich(positions, spread / SHARED**2, best.vague),
        height_offsets=offsets,
    )


def _sandwich(positions: Float64Array, spread: Float64Array, other: Float64Array) -> Float64Array:
    inverse = np.linalg.inv(positions + other)
    covariance: Float64Array = (inverse @ (spread + other) @ inverse)[
        :NUM_PARAMETERS, :NUM_PARAMETERS
    ]
    return covariance
