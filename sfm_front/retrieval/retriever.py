"""The coarse step of hierarchical retrieval, and the ranking of all photos after re-ranking.

Source: Zhan, Zhou and Yang, "A Method of Hierarchical Image Retrieval for Real-Time Photogrammetry
Based on Multiple Features", IEEE Access 2020, doi 10.1109/ACCESS.2020.2969287. Query expansion
with verified results: Chum et al., "Total recall: automatic query expansion with a generative
feature model for object retrieval", ICCV 2007.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field

from sfm_front.errors import ConfigError
from sfm_front.retrieval.index import CosineIndex, IndexOptions
from sfm_front.types import Candidate, Float32Array, RankedCandidate


@dataclass(frozen=True, kw_only=True)
class RetrievalOptions:
    """How many photos the coarse step looks at."""

    # Number of photos proposed by the global vectors.
    candidates: int = 25
    # Number of top results used for query expansion (TUNING: query-expansion).
    num_expansion: int = 5
    # How many photos the index compares.
    index: IndexOptions = field(default_factory=IndexOptions)

    def __post_init__(self) -> None:
        if self.candidates < 1:
            raise ConfigError(f"candidates must be at least 1, got {self.candidates}")
        if self.num_expansion < 0:
            raise ConfigError(f"num_expansion must not be negative, got {self.num_expansion}")


class Retriever:
    """Stores photos by their global vectors, and ranks them for a query."""

    def __init__(self, options: RetrievalOptions, dimension: int) -> None:
        self._options = options
        self._index = CosineIndex(dimension, options.index)

    def __len__(self) -> int:
        return len(self._index)

    def remember(self, image_id: int, vector: Float32Array) -> None:
        """Add a photo with its (dimension,) vector of length 1."""
        self._index.add(image_id, vector)

    def candidates(self, vector: Float32Array) -> list[Candidate]:
        """The coarse step: photos nearest to a (dimension,) global vector, expanded, best first."""
        options = self._options
        return self._index.query(vector, options.candidates, num_expansion=options.num_expansion)

    def nearest(
        self,
        image_id: int,
        count: int,
        *,
        without: Collection[int] = (),
        expand_with: Iterable[int] = (),
    ) -> list[int]:
        """Of the photos that are not in ``without``, the ``count`` nearest to a photo that is
        remembered, best first: image ids. ``expand_with``: photos known to overlap with it."""
        expand_with = list(expand_with)
        found = self._index.query(
            self._index.vector(image_id),
            count + len(without),
            num_expansion=0 if expand_with else self._options.num_expansion,
            expand_with=expand_with,
        )
        return [c.image_id for c in found if c.image_id not in without][:count]

    def rank(
        self, vector: Float32Array, reranked: Sequence[RankedCandidate], *, min_inliers: int
    ) -> list[Candidate | RankedCandidate]:
        """All photos: candidates with at least ``min_inliers``, as re-ranked, then the others.

        The others are ordered by the query expanded with the verified ones, which certainly
        overlap; without any, with its top results, as in the coarse step.
        """
        verified = [c for c in reranked if c.inliers >= min_inliers]
        first = {candidate.image_id for candidate in verified}
        others = self._index.query(
            vector,
            len(self),
            num_expansion=0 if verified else self._options.num_expansion,
            expand_with=first,
        )
        known = {candidate.image_id: candidate for candidate in reranked}
        return [*verified, *(known.get(c.image_id, c) for c in others if c.image_id not in first)]
