"""The similarity between two models that most of their matches agree with."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.geometry.similarity import Similarities
from sfm_front.mapping.point_matches import PointMatches
from sfm_front.types import Float64Array

# Matches on which hypotheses are compared, and hypotheses that are compared at a time.
_COMPARED = 1000
_BATCH = 32
# Of the differences that the optimisation takes derivatives by: radians, or shares.
_STEP = 1e-6


@dataclass(frozen=True, kw_only=True)
class SimilarityOptions:
    """How the similarity is searched for."""

    # Samples of three matches: with a third of them right, some 20 of these are clean.
    hypotheses: int = 512
    # Reprojection error of an inlier in both directions: COLMAP's for aligning models, in pixels
    # of the file.
    max_error_px: float = 8.0
    # Of the local optimisation.
    iterations: int = 10

    def __post_init__(self) -> None:
        for name in ("hypotheses", "iterations"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be at least 1, got {getattr(self, name)}")
        if self.max_error_px <= 0:
            raise ConfigError(f"max_error_px must be above 0, got {self.max_error_px}")


def estimate_similarity(
    matches: PointMatches, options: SimilarityOptions, seed: int
) -> tuple[Similarities, NDArray[np.bool_]]:
    """first_from_second by RANSAC, and which matches (K,) agree. At least three matches.

    Hypotheses come from three points of each side. They are scored by MSAC (Torr & Zisserman,
    CVIU 2000) on errors in the photos of both sides, as in ORB-SLAM3: a distance in space would be
    mostly that of far points. The best one is optimised on its inliers again and again.
    """
    rng = np.random.default_rng(seed)
    samples = rng.integers(0, len(matches), (options.hypotheses, 3))
    hypotheses = Similarities.between(matches.xyz[1][samples], matches.xyz[0][samples])
    compared = matches.some(np.sort(rng.permutation(len(matches))[:_COMPARED]))
    scores = np.concatenate(
        [
            _score(compared.errors_px(hypotheses[start : start + _BATCH]), options)
            for start in range(0, len(hypotheses), _BATCH)
        ]
    )
    best = hypotheses[int(scores.argmax())]
    score = _score(matches.errors_px(best), options)
    for _ in range(options.iterations):
        inliers = matches.some(np.flatnonzero(_inliers(matches, best, options)))
        if len(inliers) < 3:
            break
        better = _step(best, inliers)
        new_score = _score(matches.errors_px(better), options)
        if not new_score > score:
            break
        best, score = better, new_score
    return best, _inliers(matches, best, options)


def _score(errors_px: Float64Array, options: SimilarityOptions) -> Float64Array:
    """(H, K) → (H,)"""
    score: Float64Array = np.maximum(1 - (errors_px / options.max_error_px) ** 2, 0).sum(axis=1)
    return score


def _inliers(
    matches: PointMatches, similarity: Similarities, options: SimilarityOptions
) -> NDArray[np.bool_]:
    agree: NDArray[np.bool_] = matches.errors_px(similarity)[0] < options.max_error_px
    return agree


def _step(similarity: Similarities, inliers: PointMatches) -> Similarities:
    """One Gauss-Newton step on the reprojection errors of both sides."""
    center = inliers.xyz[0].mean(axis=0)
    extent = float(np.linalg.norm(inliers.xyz[0] - center, axis=1).mean())
    steps = np.vstack([np.zeros(7), _STEP * np.eye(7)])
    residuals = inliers.residuals_px(_changed(similarity, steps, center, extent))
    residuals = residuals.reshape(len(steps), -1)
    jacobian = (residuals[1:] - residuals[0]).T / _STEP
    change, *_ = np.linalg.lstsq(jacobian, -residuals[0], rcond=None)
    return _changed(similarity, change[None], center, extent)


def _changed(
    similarity: Similarities, changes: Float64Array, center: Float64Array, extent: float
) -> Similarities:
    """A similarity followed by each of small ones (H, 7): logarithm of the scale, rotation vector
    and shift in extents, round a centre."""
    rotations = np.array([cv2.Rodrigues(change)[0] for change in changes[:, 1:4]])
    scales = np.exp(changes[:, 0])
    away = similarity.translations - center
    translations = scales[:, None] * np.einsum("hij,nj->hi", rotations, away)
    return Similarities(
        scales * similarity.scales,
        rotations @ similarity.rotations,
        translations + center + changes[:, 4:] * extent,
    )
