"""Hierarchical retrieval: cosine candidates, re-ranked; the most relevant photo first.

Source: Zhan, Zhou and Yang, "A Method of Hierarchical Image Retrieval for Real-Time Photogrammetry
Based on Multiple Features", IEEE Access 2020, doi 10.1109/ACCESS.2020.2969287.
"""

from __future__ import annotations

from dataclasses import dataclass

from sfm_front.errors import ConfigError
from sfm_front.retrieval.index import CosineIndex
from sfm_front.retrieval.rerank import Reranker
from sfm_front.types import Candidate, Float32Array
from sfm_front.verification import View


@dataclass(frozen=True, kw_only=True)
class RetrievalOptions:
    """``candidates``: photos that the global vectors propose. ``widen_by``: so many of the best
    are added to the query before, see ``CosineIndex.query``."""

    candidates: int = 25
    widen_by: int = 5

    def __post_init__(self) -> None:
        if self.candidates < 1:
            raise ConfigError(f"candidates must be at least 1, got {self.candidates}")
        if self.widen_by < 0:
            raise ConfigError(f"widen_by must not be negative, got {self.widen_by}")


class Retriever:
    """Remembers photos and ranks them for a new one."""

    def __init__(self, options: RetrievalOptions, dimension: int, reranker: Reranker) -> None:
        self._options = options
        self._index = CosineIndex(dimension)
        self._reranker = reranker
        self.views: dict[int, View] = {}
        """The photos it remembers, by image id."""

    def candidates(self, vector: Float32Array) -> list[Candidate]:
        """The coarse step: photos by a (dimension,) global vector and its best, best first."""
        options = self._options
        return self._index.query(vector, options.candidates, widen_by=options.widen_by)

    def rerank(self, query: View, candidates: list[Candidate]) -> list[Candidate]:
        """The fine step: candidates by verified matches; the first is the most relevant photo."""
        return self._reranker.rerank(query, candidates, self.views)

    def remember(self, view: View, vector: Float32Array) -> None:
        """Let later photos find this one."""
        self._index.add(view.image_id, vector)
        self.views[view.image_id] = view
