"""enu_from_model by robust, weighted least squares, from a start that is near."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from sfm_front.geometry.similarity import Similarities
from sfm_front.georeference.consensus import SHARED, Floor
from sfm_front.georeference.fixes import Fixes
from sfm_front.georeference.levelling import LevelCameras
from sfm_front.types import Float64Array

NUM_PARAMETERS = 7
"""Logarithm of the scale, rotation vector and shift in metres, in ENU and round a pivot."""

# Degrees of freedom of Student's t distribution of the errors: how far its tails reach.
_TAILS = 5.0
# What the claimed standard deviations weigh against the residuals, in observations: enough for
# three fixes, which leave next to nothing.
_PRIOR_OBSERVATIONS = 0.1
_MAX_STEPS = 20
# Of a step that changes nothing, in standard deviations.
_STILL = 0.03
# Standard deviation of what is known beforehand, so that what nothing else fixes comes out as open.
_VAGUE = np.array([1.0, *[1.0] * 3, *[1e4] * 3])
_VAGUE_OFFSET_M = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A similarity and what its errors follow from.

    ``offsets`` (F,): heights of the flights against the first one, in metres. ``residuals`` (N, 3)
    of the fixes in metres, ``sigmas`` (N, 3) their standard deviations as the residuals have them.
    ``design`` (N, 3, 7 + F): change of the moved centres (and heights) with the parameters, per
    standard deviation. ``level`` (7 + F, 7 + F): information of level cameras, zeros without.
    ``vague``: what is known beforehand. ``cost``: twice the negative logarithm of the likelihood.
    """

    similarity: Similarities
    offsets: Float64Array
    pivot: Float64Array
    residuals: Float64Array
    sigmas: Float64Array
    design: Float64Array
    level: Float64Array
    vague: Float64Array
    cost: float


def fit(
    start: Similarities,
    centres: Float64Array,
    fixes: Fixes,
    floor: Floor,
    level: LevelCameras | None,
    columns: Float64Array,
) -> Fit:
    """The most likely similarity from camera centres (N, 3) to fixes that are right.

    Gauss-Newton where the errors follow Student's t distribution, whose scale is estimated for
    heights and for the rest, by expectation maximisation (K. Lange,
    R. Little & J. Taylor, "Robust statistical modeling using the t distribution", JASA 1989).
    ``columns`` (N, F): 1 for the photos of each flight whose height has an offset of its own.
    """
    similarity, offsets = start, np.zeros(columns.shape[1])
    variances = floor.variances(fixes)
    scales = np.ones(3)  # of the standard deviations, by axis
    vague = np.diag(1 / np.append(_VAGUE, np.full(len(offsets), _VAGUE_OFFSET_M)) ** 2)
    for step in range(_MAX_STEPS + 1):
        moved = similarity(centres)[0]
        residuals = np.where(fixes.known, fixes.enu - moved, 0.0)
        residuals[:, 2] -= columns @ offsets * fixes.known[:, 2]
        weights, scales = _weigh(residuals, variances, fixes, scales, first=step == 0)
        sigmas = scales * np.sqrt(variances)
        pivot = np.average(moved, axis=0, weights=weights)
        design = _design(moved - pivot, columns) / sigmas[:, :, None]
        level_information, level_right = _level_terms(level, similarity, len(vague))
        if step == _MAX_STEPS:
            break
        flat = (design * np.sqrt(weights)[:, None, None]).reshape(-1, len(vague))
        right = flat.T @ (residuals / sigmas * np.sqrt(weights)[:, None]).ravel()
        right = right / SHARED + level_right
        normal = flat.T @ flat / SHARED + level_information + vague
        change = np.linalg.solve(normal, right)
        if change @ normal @ change < _STILL**2 and step > 1:
            break
        similarity = _stepped(similarity, change[:NUM_PARAMETERS], pivot)
        offsets = offsets + change[NUM_PARAMETERS:]
    squares = np.sum((residuals / sigmas) ** 2, axis=1)
    observed = fixes.known.sum(axis=1)
    cost = np.sum((_TAILS + observed) * np.log1p(squares / _TAILS))
    cost += 2 * np.sum(np.log(np.where(fixes.known, sigmas, 1.0)))
    cost /= SHARED
    if level is not None:
        cost += level.costs(similarity)[0]
    return Fit(
        similarity, offsets, pivot, residuals, sigmas, design, level_information, vague, float(cost)
    )


def _weigh(
    residuals: Float64Array,
    variances: Float64Array,
    fixes: Fixes,
    scales: Float64Array,
    *,
    first: bool,
) -> tuple[Float64Array, Float64Array]:
    """Weights (N,) of the fixes and factors (3,) of their standard deviations, from those before.

    To start with, all weigh the same.
    """
    squares = residuals**2 / variances
    known = fixes.known.sum(axis=1)
    weights = np.ones(len(fixes))
    for _ in range(1 if first else 2):
        if not first:
            weights = (_TAILS + known) / (_TAILS + (squares / scales**2).sum(axis=1))
        total = fixes.known.sum(axis=0) * max(1 - NUM_PARAMETERS / known.sum(), 0.0)
        sums = weights @ squares
        east_north = (_PRIOR_OBSERVATIONS + sums[:2].sum()) / (
            _PRIOR_OBSERVATIONS + total[:2].sum()
        )
        up = (_PRIOR_OBSERVATIONS + sums[2]) / (_PRIOR_OBSERVATIONS + total[2])
        scales = np.sqrt([east_north, east_north, up])
    return weights, scales


def _design(arms: Float64Array, columns: Float64Array) -> Float64Array:
    """(N, 3, 7 + F): change of moved centres, ``arms`` (N, 3) from the pivot, in metres."""
    return np.concatenate([change_of_points(arms), _heights_only(columns)], axis=2)


def change_of_points(arms: Float64Array) -> Float64Array:
    """(N, 3, 7): how points move with the parameters, ``arms`` (N, 3) away from the pivot."""
    change = np.zeros((len(arms), 3, NUM_PARAMETERS))
    east, north, up = arms.T
    change[:, :, 0] = arms
    # ω × arm
    change[:, 1, 1], change[:, 2, 1] = -up, north
    change[:, 0, 2], change[:, 2, 2] = up, -east
    change[:, 0, 3], change[:, 1, 3] = -north, east
    change[:, :, 4:] = np.eye(3)
    return change


def _heights_only(columns: Float64Array) -> Float64Array:
    rows = np.zeros((len(columns), 3, columns.shape[1]))
    rows[:, 2] = columns
    return rows


def _level_terms(
    level: LevelCameras | None, similarity: Similarities, size: int
) -> tuple[Float64Array, Float64Array]:
    """Their part in the normal equations: matrix and right-hand side."""
    matrix, right = np.zeros((size, size)), np.zeros(size)
    if level is not None and level.are_level(similarity):
        rows = level.rows(similarity)
        matrix[1:4, 1:4] = rows.by_rotation.T @ rows.by_rotation
        right[1:4] = rows.by_rotation.T @ rows.residuals
    return matrix, right


def _stepped(similarity: Similarities, change: Float64Array, pivot: Float64Array) -> Similarities:
    scale = np.exp(np.clip(change[0], -1.0, 1.0))
    rotation = cv2.Rodrigues(change[1:4])[0]
    return Similarities(
        scale * similarity.scales,
        rotation @ similarity.rotations,
        scale * (similarity.translations - pivot) @ rotation.T + pivot + change[4:7],
    )
