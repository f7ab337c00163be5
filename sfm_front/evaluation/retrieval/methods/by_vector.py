"""Rank by one global vector alone: the paper's "CNN only", and VLAD."""

from __future__ import annotations

from collections.abc import Sequence

from sfm_front.evaluation.retrieval.types import BenchPhoto, Ranked
from sfm_front.retrieval.index import CosineIndex


class ByVector:
    """Ranks all photos by the cosine of their global vectors, exactly."""

    def __init__(self, name: str) -> None:
        """``name`` of the method and of its vectors in ``BenchPhoto.vectors``."""
        self.name = name
        self.global_vectors = (name,)

    def build(self, photos: Sequence[BenchPhoto]) -> None:
        self._index = CosineIndex(len(photos[0].vectors[self.name]) if photos else 0)
        for photo in photos:
            self._index.add(photo.view.image_id, photo.vectors[self.name])

    def rank(self, query: BenchPhoto) -> list[Ranked]:
        found = self._index.query(query.vectors[self.name], len(self._index))
        return [Ranked(c.image_id, c.cosine, cosine=c.cosine) for c in found]
