"""A photo's SIFT descriptors → global vector, without a network: VLAD.

Descriptors are projected, partly whitened and assigned to their nearest visual word. Each residual
is normalised, weighted by the square root of its keypoint's scale, and summed per word. Each word's
sum is normalised again, so that neither a repeated texture nor a crowded word outweighs the rest,
and finally whitened: what all photos have in common at a word does not distinguish them
(TUNING: vlad-words, vlad-whitening).

Sources: Jegou et al., "Aggregating local image descriptors into compact codes", PAMI 2012;
Arandjelovic and Zisserman, "All about VLAD", CVPR 2013 (each word's sum at length 1); Delhumeau
et al., "Revisiting the VLAD image representation", ACM Multimedia 2013 (residuals of length 1, a
basis for each word).
"""

from __future__ import annotations

import numpy as np

from sfm_front.features.global_descriptors.codebook import Codebook
from sfm_front.features.global_descriptors.unit_vectors import unit_length
from sfm_front.features.global_descriptors.visual_words import VisualWords
from sfm_front.types import Features, Float32Array


class Vlad:
    """Describes photos by their SIFT features. Thread-safe."""

    name = "vlad"

    def __init__(self, codebook: Codebook | None = None) -> None:
        """``codebook`` defaults to the one that ships with the package."""
        codebook = Codebook.load() if codebook is None else codebook
        self._words = VisualWords(codebook.mean, codebook.projection, codebook.words)
        self._whitening = codebook.whitening.astype(np.float32)
        self.dimension = codebook.words.size
        self.fingerprint = f"{self.name}:{codebook.fingerprint}"

    def describe(self, features: Features) -> Float32Array:
        """(dimension,) float32 of length 1, or zeros for a photo without features."""
        directions = self._words.directions(features)
        return unit_length((self._whitening @ directions[..., np.newaxis]).ravel())
