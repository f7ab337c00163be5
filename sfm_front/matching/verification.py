"""Tentative matches → PairGeometry, or the reason for rejection."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.geometry.epipolar_error import fits_epipolar
from sfm_front.geometry.rays import undistorted_rays
from sfm_front.types import (
    Float64Array,
    PairGeometry,
    Rejected,
    Rejection,
    Uint32Array,
    View,
)

_WATERMARK = int(pycolmap.TwoViewGeometryConfiguration.WATERMARK)
CALIBRATED = int(pycolmap.TwoViewGeometryConfiguration.CALIBRATED)


@dataclass(frozen=True, kw_only=True)
class VerificationOptions:
    """When two photos count as overlapping."""

    # Largest epipolar error of an inlier, in pixels of the file.
    max_error_px: float = 4.0
    # Fewest inliers of a two-view geometry.
    min_inliers: int = 15
    # Most RANSAC trials of the gate, a fundamental matrix.
    max_gate_trials: int = 2000
    # Probability that one of the gate's trials is free of outliers; it ends once that is reached.
    gate_confidence: float = 0.999
    # Number of gate inliers that the two-view model is estimated from; all matches are then
    # tested on it.
    model_sample: int = 300
    # Fewest RANSAC trials of the two-view model. The gate leaves hardly any outliers: COLMAP's 100
    # trials would mostly repeat each other.
    min_model_trials: int = 30
    # Of the model's samples; the gate always draws the same samples.
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.max_error_px > 0:
            raise ConfigError(f"max_error_px must be above 0, got {self.max_error_px}")
        if self.min_inliers < 8:
            raise ConfigError(f"min_inliers must be at least 8, got {self.min_inliers}")
        if self.model_sample < self.min_inliers:
            raise ConfigError(
                f"model_sample must be at least min_inliers ({self.min_inliers}), "
                f"got {self.model_sample}"
            )
        if self.max_gate_trials < 1:
            raise ConfigError(f"max_gate_trials must be at least 1, got {self.max_gate_trials}")
        if not 0 < self.gate_confidence < 1:
            raise ConfigError(
                f"gate_confidence must be above 0 and below 1, got {self.gate_confidence}"
            )
        most = pycolmap.TwoViewGeometryOptions().ransac.max_num_trials
        if not 1 <= self.min_model_trials <= most:
            raise ConfigError(
                f"min_model_trials must be from 1 to {most}, got {self.min_model_trials}"
            )


class Verifier:
    """Estimates two-view geometry. Deterministic and thread-safe."""

    def __init__(self, options: VerificationOptions | None = None) -> None:
        self.options = options or VerificationOptions()
        self._model_options = pycolmap.TwoViewGeometryOptions()
        self._model_options.min_num_inliers = self.options.min_inliers
        self._model_options.compute_relative_pose = True
        ransac = self._model_options.ransac
        ransac.max_error = self.options.max_error_px
        ransac.random_seed = self.options.seed
        ransac.min_num_trials = self.options.min_model_trials

    def inliers(self, view1: View, view2: View, matches: Uint32Array) -> Uint32Array:
        """(K, 2) inliers of a fundamental matrix, by RANSAC; none if no matrix is found."""
        return matches[self._gate(view1, view2, matches)]

    def count_inliers(self, view1: View, view2: View, matches: Uint32Array) -> int:
        """Number of inliers."""
        return len(self.inliers(view1, view2, matches))

    def verify(self, view1: View, view2: View, matches: Uint32Array) -> PairGeometry | Rejected:
        """Two-view geometry of two photos from their tentative matches (M, 2).

        A fundamental matrix (OpenCV's USAC) is the gate: without overlap it takes milliseconds,
        COLMAP's calibrated estimate up to a second. The calibrated estimate then sees a sample of
        the gate's inliers, and its essential matrix is tested on every match.
        """
        options = self.options

        def rejected(reason: Rejection, num_inliers: int) -> Rejected:
            return Rejected(reason, len(matches), num_inliers)

        if len(matches) < options.min_inliers:
            return rejected(Rejection.TOO_FEW_MATCHES, 0)
        gate = self._gate(view1, view2, matches)
        survivors = np.flatnonzero(gate)
        if len(survivors) < options.min_inliers:
            return rejected(Rejection.NO_EPIPOLAR_GEOMETRY, len(survivors))
        geometry = self._estimate(view1, view2, matches[self._sample(survivors)])
        if geometry.config == _WATERMARK:
            return rejected(Rejection.WATERMARK, len(geometry.inlier_matches))
        if len(geometry.inlier_matches) < options.min_inliers:
            return rejected(Rejection.TOO_FEW_INLIERS, len(geometry.inlier_matches))
        if geometry.config == CALIBRATED and geometry.E is not None:
            consistent = self._essential_inliers(geometry.E, view1, view2, matches)
            if np.count_nonzero(consistent) > len(survivors):
                survivors = np.flatnonzero(consistent)
        geometry.inlier_matches = matches[survivors]
        return PairGeometry(view1.image_id, view2.image_id, matches, geometry)

    def _gate(self, view1: View, view2: View, matches: Uint32Array) -> NDArray[np.bool_]:
        """(M,) inliers of the best fundamental matrix; all False if none is found."""
        nothing = np.zeros(len(matches), np.bool_)
        if len(matches) < 8:
            return nothing
        try:
            _, mask = cv2.findFundamentalMat(
                view1.points(matches[:, 0]),
                view2.points(matches[:, 1]),
                cv2.USAC_ACCURATE,
                self.options.max_error_px,
                self.options.gate_confidence,
                self.options.max_gate_trials,
            )
        except cv2.error:
            # OpenCV 5.0 fails an assertion inside USAC if no sample gave a model.
            return nothing
        return nothing if mask is None else mask.ravel().astype(np.bool_)

    def _sample(self, survivors: NDArray[np.intp]) -> NDArray[np.intp]:
        if len(survivors) <= self.options.model_sample:
            return survivors
        rng = np.random.default_rng(self.options.seed)
        return np.sort(rng.choice(survivors, self.options.model_sample, replace=False))

    def _estimate(self, view1: View, view2: View, matches: Uint32Array) -> pycolmap.TwoViewGeometry:
        aligned = np.repeat(np.arange(len(matches), dtype=np.uint32)[:, None], 2, axis=1)
        return pycolmap.estimate_calibrated_two_view_geometry(
            view1.camera,
            view1.points(matches[:, 0]),
            view2.camera,
            view2.points(matches[:, 1]),
            aligned,
            self._model_options,
        )

    def _essential_inliers(
        self, essential: Float64Array, view1: View, view2: View, matches: Uint32Array
    ) -> NDArray[np.bool_]:
        """(M,) whether each match's Sampson error under x2ᵀ E x1 = 0 is at most max_error_px."""
        rays1 = undistorted_rays(view1.camera, view1.points(matches[:, 0]))
        rays2 = undistorted_rays(view2.camera, view2.points(matches[:, 1]))
        focal_px = 0.5 * (view1.camera.mean_focal_length() + view2.camera.mean_focal_length())
        return fits_epipolar(essential, rays1, rays2, self.options.max_error_px / focal_px)
