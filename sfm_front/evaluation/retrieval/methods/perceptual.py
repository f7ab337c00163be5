"""Rank by the Hamming distance of perceptual hashes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sfm_front.evaluation.retrieval.perceptual_hash import BITS
from sfm_front.evaluation.retrieval.types import BenchPhoto, Ranked


class ByPerceptualHash:
    """Ranks all photos by the number of equal bits; the score is their fraction."""

    name = "phash"
    global_vectors = ()

    def build(self, photos: Sequence[BenchPhoto]) -> None:
        self._ids = [photo.view.image_id for photo in photos]
        self._hashes = np.stack([photo.perceptual_hash for photo in photos])

    def rank(self, query: BenchPhoto) -> list[Ranked]:
        different = np.unpackbits(self._hashes ^ query.perceptual_hash, axis=1).sum(axis=1)
        order = np.argsort(different, kind="stable")
        return [Ranked(self._ids[i], 1 - float(different[i]) / BITS) for i in order]
