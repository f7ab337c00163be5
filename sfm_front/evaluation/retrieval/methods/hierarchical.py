"""Ours: global vectors propose photos, verified SIFT matches order them.

Source: Zhan, Zhou and Yang, "A Method of Hierarchical Image Retrieval for Real-Time Photogrammetry
Based on Multiple Features", IEEE Access 2020, doi 10.1109/ACCESS.2020.2969287.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sfm_front.evaluation.retrieval.methods.by_vector import index_of
from sfm_front.evaluation.retrieval.types import BenchPhoto, Ranked
from sfm_front.features.vlad import Vlad
from sfm_front.matcher import CpuMatcher, Matcher
from sfm_front.matching import MatchingOptions
from sfm_front.retrieval.rerank import Reranker, RerankOptions
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.stopwatch import Stopwatch
from sfm_front.types import Candidate
from sfm_front.verification import Verifier
from sfm_front.workers import Workers


class Hierarchical:
    """Ranks the best photos by cosine anew by inliers; the others follow by cosine."""

    name = "ours"

    def __init__(
        self,
        workers: Workers,
        *,
        vector: str = Vlad.name,
        retrieval: RetrievalOptions | None = None,
        rerank: RerankOptions | None = None,
        matcher: Matcher | None = None,
    ) -> None:
        """``vector``: the global vector's name in ``BenchPhoto.vectors``; ``matcher``: what
        matches candidates, the processor by default."""
        self.vector = vector
        if vector != Vlad.name:
            self.name = f"{self.name}:{vector}"
        self.global_vectors = (vector,)
        self._retrieval = retrieval or RetrievalOptions()
        self._reranker = Reranker(
            rerank or RerankOptions(),
            matcher or CpuMatcher(MatchingOptions(), workers),
            Verifier(),
            workers,
        )
        self.seconds: Mapping[str, float] = {}
        """Of the last query: its ``coarse`` and its ``fine`` step."""

    def build(self, photos: Sequence[BenchPhoto]) -> None:
        self._index = index_of(photos, self.vector)
        self._views = {photo.view.image_id: photo.view for photo in photos}

    def search(self, query: BenchPhoto) -> list[Candidate]:
        """The candidates alone, best first: what a photo costs in a reconstruction."""
        clock = Stopwatch()
        with clock.stage("coarse"):
            proposed = self._index.query(
                query.vectors[self.vector],
                self._retrieval.candidates,
                widen_by=self._retrieval.widen_by,
            )
        with clock.stage("fine"):
            ranked = self._reranker.rerank(query.view, proposed, self._views)
        self.seconds = clock.seconds
        return ranked

    def rank(self, query: BenchPhoto) -> list[Ranked]:
        best = self.search(query)
        found = {candidate.image_id for candidate in best}
        # A cosine is at most 1, so any inlier at all outweighs it.
        ranked = [
            Ranked(c.image_id, 1 + (c.inliers or 0) + c.cosine, c.cosine, c.inliers) for c in best
        ]
        everything = self._index.query(query.vectors[self.vector], len(self._index))
        rest = (c for c in everything if c.image_id not in found)
        return ranked + [Ranked(c.image_id, c.cosine - 2, c.cosine) for c in rest]
