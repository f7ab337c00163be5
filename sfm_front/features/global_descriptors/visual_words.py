"""A photo's SIFT features → their mean residual direction at each visual word."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sfm_front.features.global_descriptors.unit_vectors import unit_length
from sfm_front.types import Features, Float32Array, Uint8Array


class VisualWords:
    """Centres of clusters of projected descriptors. Thread-safe."""

    def __init__(
        self,
        mean: NDArray[np.floating],
        projection: NDArray[np.floating],
        words: NDArray[np.floating],
    ) -> None:
        """As in ``Codebook``: ``mean`` (128,), ``projection`` (128, d), ``words`` (k, d)."""
        self._projection = projection.astype(np.float32)
        self._projected_mean = mean.astype(np.float32) @ self._projection
        self._words = np.ascontiguousarray(words, np.float32)
        # The nearest word maximises point · word - |word|² / 2: one matrix product.
        self._half_squares = np.square(self._words).sum(axis=1) / 2
        self.count, self.dimension = self._words.shape

    def project(self, descriptors: Uint8Array) -> Float32Array:
        """(N, 128) uint8 RootSIFT → (N, d) float32 in the space of the words."""
        points: Float32Array = descriptors.astype(np.float32) @ self._projection
        points -= self._projected_mean
        return points

    def directions(self, features: Features) -> Float32Array:
        """(k, d) float32: per word the unit direction of the summed residuals of its descriptors;
        zeros at a word without any."""
        points = self.project(features.descriptors)
        nearness = points @ self._words.T
        # In place: a second array of this size would take as long as the product.
        nearness -= self._half_squares
        nearest = nearness.argmax(axis=1)
        residuals = unit_length(points - self._words[nearest])
        # Large keypoints are rare, and show structure rather than texture.
        residuals *= np.sqrt(features.keypoints[:, 2:3])
        sums = np.zeros_like(self._words)
        # Sorting by word makes each word's rows one run: far faster than np.add.at.
        order = np.argsort(nearest, kind="stable")
        found, starts = np.unique(nearest[order], return_index=True)
        sums[found] = np.add.reduceat(residuals[order], starts, axis=0)
        return unit_length(sums)
