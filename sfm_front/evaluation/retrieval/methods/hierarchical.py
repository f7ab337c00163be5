"""Ours: global vectors propose photos, verified SIFT matches order them.

Source: Zhan, Zhou and Yang, "A Method of Hierarchical Image Retrieval for Real-Time Photogrammetry
Based on Multiple Features", IEEE Access 2020, doi 10.1109/ACCESS.2020.2969287.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sfm_front.evaluation.retrieval.types import BenchPhoto, Ranked
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.matching.matcher import CpuMatcher
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.matching.verification import Verifier
from sfm_front.retrieval.rerank import Reranker, RerankOptions
from sfm_front.retrieval.retriever import RetrievalOptions, Retriever
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.runtime.worker_pool import WorkerPool


class Hierarchical:
    """The session's retriever, ranking all photos."""

    name = "ours"

    def __init__(
        self,
        workers: WorkerPool,
        *,
        vector: str = Vlad.name,
        retrieval: RetrievalOptions | None = None,
        rerank: RerankOptions | None = None,
    ) -> None:
        """``vector``: the global vector's name in ``BenchPhoto.vectors``."""
        self.vector = vector
        if vector != Vlad.name:
            self.name = f"{self.name}:{vector}"
        self.global_vectors = (vector,)
        self._retrieval = retrieval or RetrievalOptions()
        self._verifier = Verifier()
        self._reranker = Reranker(
            rerank or RerankOptions(),
            CpuMatcher(MatchingOptions(), workers),
            self._verifier,
            workers,
        )
        self.seconds: Mapping[str, float] = {}
        """Of the last query: its ``coarse`` and its ``fine`` step."""

    def build(self, photos: Sequence[BenchPhoto]) -> None:
        dimension = len(photos[0].vectors[self.vector]) if photos else 0
        self._retriever = Retriever(self._retrieval, dimension)
        self._views = {photo.view.image_id: photo.view for photo in photos}
        for photo in photos:
            self._retriever.remember(photo.view.image_id, photo.vectors[self.vector])

    def rank(self, query: BenchPhoto) -> list[Ranked]:
        vector = query.vectors[self.vector]
        clock = Stopwatch()
        with clock.stage("coarse"):
            proposed = self._retriever.candidates(vector)
        with clock.stage("fine"):
            reranked = self._reranker.rerank(query.view, proposed, self._views)
        self.seconds = clock.seconds
        ranked = self._retriever.rank(
            vector, reranked, min_inliers=self._verifier.options.min_inliers
        )
        return [Ranked(c.image_id, -place, c.cosine, c.inliers) for place, c in enumerate(ranked)]
