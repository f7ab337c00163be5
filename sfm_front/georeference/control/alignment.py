"""The similarity that brings triangulated points onto surveyed ones."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, islice

import cv2
import numpy as np
from numpy.typing import NDArray

from sfm_front.geometry.similarity import Similarities
from sfm_front.georeference.control.surveyed import Surveyed
from sfm_front.types import Float64Array

# Samples of three that are looked at: all of them up to 24 points.
_MAX_SAMPLES = 2024
# Width over length below which three points are as good as on a line.
_MIN_WIDTH = 0.02
# Of an outlier, in the residuals that most points stay within, and in standard deviations.
_OUTLIER = 3.0
_OUTLIER_SIGMAS = 5.0
_ITERATIONS = 10


@dataclass(frozen=True, slots=True, eq=False)
class ControlAlignment:
    """``enu_from_model``, and which points (N,) agree with it."""

    enu_from_model: Similarities
    agree: NDArray[np.bool_]


def align_to_surveyed(points: Float64Array, surveyed: Surveyed) -> ControlAlignment | None:
    """Least squares on the points that agree; None if no three of them form a triangle.

    ``points`` (N, 3) in the model. Which agree is said by least quantiles of squares over samples
    of three (P. Rousseeuw & A. Leroy, "Robust regression and outlier detection", 1987): a model may
    be bent by far more than the points' standard deviations, so these say little. Of four points
    or fewer all have to be believed.
    """
    samples = _triangles(points, surveyed.enu)
    if not len(samples):
        return None
    hypotheses = Similarities.between(points[samples], surveyed.enu[samples])
    norms = _norms(hypotheses, points, surveyed)
    # Of all quantiles this one withstands most outliers.
    needed = min(len(surveyed) // 2 + 2, len(surveyed))
    within = np.sort(norms, axis=1)[:, needed - 1]
    best = int(np.nanargmin(within))
    similarity = hypotheses[best]
    limit = max(
        _OUTLIER * float(within[best]),
        _OUTLIER_SIGMAS * float(np.median(np.linalg.norm(surveyed.sigmas[:, :2], axis=1))),
    )
    agree = norms[best] <= limit
    for _ in range(_ITERATIONS):
        similarity = _fitted(similarity, points[agree], surveyed[agree])
        before, agree = agree, _norms(similarity, points, surveyed)[0] <= limit
        if agree.sum() < needed:
            agree = before
        if (agree == before).all():
            break
    return ControlAlignment(similarity, agree)


def _triangles(points: Float64Array, enu: Float64Array) -> NDArray[np.int64]:
    """(S, 3) points that are on no line, neither in the model nor surveyed."""
    samples = np.array(list(islice(combinations(range(len(points)), 3), _MAX_SAMPLES)), np.int64)
    wide = np.ones(len(samples), bool)
    for places in (points, enu):
        if len(samples):
            corners = places[samples] - places[samples].mean(axis=1, keepdims=True)
            extents = np.linalg.svd(corners, compute_uv=False)
            wide &= extents[:, 1] > _MIN_WIDTH * extents[:, 0]
    return samples[wide]


def _norms(similarity: Similarities, points: Float64Array, surveyed: Surveyed) -> Float64Array:
    """(H, N) metres, of unknown heights nothing."""
    residuals = similarity(points) - surveyed.enu
    residuals[:, ~surveyed.has_height, 2] = 0
    norms: Float64Array = np.linalg.norm(residuals, axis=2)
    return norms


def _fitted(start: Similarities, points: Float64Array, surveyed: Surveyed) -> Similarities:
    """Gauss-Newton on residuals in standard deviations, which are as much larger than stated as the
    residuals say: else assumed heights, which level the model, would count for nothing."""
    similarity = start
    measured = np.ones((len(points), 3), bool)
    measured[:, 2] = surveyed.has_height
    redundancy = max(measured.sum() - 7, 1)
    for _ in range(_ITERATIONS):
        moved = similarity(points)[0]
        off = ((moved - surveyed.enu) / surveyed.sigmas)[measured]
        factor = max(1.0, float(np.sqrt((off**2).sum() / redundancy)))
        pivot = moved.mean(axis=0)
        arms = moved - pivot
        extent = float(np.linalg.norm(arms, axis=1).mean())
        # Logarithm of the scale, rotation vector, shift in extents.
        rows = np.zeros((len(points), 3, 7))
        rows[:, :, 0] = arms
        for axis, unit in enumerate(np.eye(3)):
            rows[:, :, 1 + axis] = np.cross(unit, arms)
        rows[:, :, 4:] = extent * np.eye(3)
        weights = 1 / np.where(measured, factor * surveyed.sigmas, surveyed.sigmas)
        change, *_ = np.linalg.lstsq(
            (rows * weights[:, :, None]).reshape(-1, 7),
            ((surveyed.enu - moved) * weights).ravel(),
            rcond=None,
        )
        rotation = cv2.Rodrigues(change[1:4])[0]
        scale = float(np.exp(change[0]))
        away = similarity.translations - pivot
        similarity = Similarities(
            scale * similarity.scales,
            rotation @ similarity.rotations,
            scale * away @ rotation.T + pivot + extent * change[4:],
        )
        if np.abs(change).max() < 1e-10:
            break
    return similarity
