"""Coarse retrieval: a growing cosine index over global vectors."""

from __future__ import annotations

import numpy as np

from sfm_front.types import Candidate, Float32Array


class CosineIndex:
    """Unit vectors of photos, searched exactly. Adding is amortised constant time."""

    def __init__(self, dimension: int) -> None:
        self._vectors: Float32Array = np.empty((64, dimension), np.float32)
        self._image_ids: list[int] = []

    def __len__(self) -> int:
        return len(self._image_ids)

    def add(self, image_id: int, vector: Float32Array) -> None:
        """Remember a photo by its (dimension,) vector of length 1."""
        count = len(self._image_ids)
        if count == len(self._vectors):
            grown = np.empty((2 * count, self._vectors.shape[1]), np.float32)
            grown[:count] = self._vectors
            self._vectors = grown
        self._vectors[count] = vector
        self._image_ids.append(image_id)

    def query(self, vector: Float32Array, count: int) -> list[Candidate]:
        """The ``count`` photos of highest cosine with the (dimension,) vector, best first."""
        cosines = self._vectors[: len(self._image_ids)] @ vector
        best = np.argsort(-cosines, kind="stable")[:count]
        return [Candidate(self._image_ids[i], float(cosines[i])) for i in best]
