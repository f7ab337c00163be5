"""A photo's SIFT descriptors → global vector, without a network: VLAD.

The descriptors are projected and partly whitened, and each goes to its nearest visual word. What
remains of it after subtracting the word is brought to length 1, weighted by the square root of its
keypoint's scale, and summed with the others of that word. Each word's sum is brought to length 1
again, so that neither a repeated texture nor a crowded word outweighs the rest.

Measured on 369 photos of 14 scenes, 4000 features each, with words and projection learnt on other
scenes than those tested: mAP 0.889 with all 479 photos in one index and 0.925 with each scene in
one of its own (0.884 and 0.922 without the weights by scale, 0.879 and 0.915 with 256 words).
Subtracting the mean of what the index holds gained 0.01 in the first case and lost 0.02 in the
second, which is the usual one: vectors are left as they are.

Sources: Jegou et al., "Aggregating local image descriptors into compact codes", PAMI 2012;
Arandjelovic and Zisserman, "All about VLAD", CVPR 2013 (each word's sum at length 1); Delhumeau
et al., "Revisiting the VLAD image representation", ACM Multimedia 2013 (residuals of length 1).
"""

from __future__ import annotations

import numpy as np

from sfm_front.features.codebook import Codebook
from sfm_front.features.vectors import unit_length
from sfm_front.types import Features, Float32Array


class Vlad:
    """Describes photos by their SIFT features. Safe to share between threads."""

    name = "vlad"

    def __init__(self, codebook: Codebook | None = None) -> None:
        """``codebook`` defaults to the one that ships with the package."""
        codebook = Codebook.load() if codebook is None else codebook
        self._projection = codebook.projection.astype(np.float32)
        self._projected_mean = codebook.mean.astype(np.float32) @ self._projection
        self._words = np.ascontiguousarray(codebook.words, np.float32)
        # The nearest word maximises point · word - |word|² / 2: one matrix product.
        self._half_squares = np.square(self._words).sum(axis=1) / 2
        self.dimension = self._words.size
        self.fingerprint = f"{self.name}:{codebook.fingerprint}"

    def describe(self, features: Features) -> Float32Array:
        """(dimension,) float32 of length 1, or zeros for a photo without features."""
        if len(features) == 0:
            return np.zeros(self.dimension, np.float32)
        points = features.descriptors.astype(np.float32) @ self._projection - self._projected_mean
        nearness = points @ self._words.T
        # In place: a second array of this size would take as long as the product.
        nearness -= self._half_squares
        nearest = nearness.argmax(axis=1)
        residuals = unit_length(points - self._words[nearest])
        # Large keypoints are few, and what they show is the scene rather than its texture.
        residuals *= np.sqrt(features.keypoints[:, 2:3])
        sums = np.zeros_like(self._words)
        # Sorting by word makes each word's rows one run: far faster than np.add.at.
        order = np.argsort(nearest, kind="stable")
        found, starts = np.unique(nearest[order], return_index=True)
        sums[found] = np.add.reduceat(residuals[order], starts, axis=0)
        return unit_length(unit_length(sums).ravel())
