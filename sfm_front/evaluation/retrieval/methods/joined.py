"""Several methods, their rankings joined by votes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sfm_front.evaluation.retrieval.types import BenchPhoto, Method, Ranked, Staged
from sfm_front.runtime.stopwatch import Stopwatch

_DAMPING = 60
"""Ranks well below this count almost equally; the value is the source's."""


class Joined:
    """Each method votes 1 / (60 + rank) for a photo; the sums order the photos.

    Source: Cormack, Clarke and Buettcher, "Reciprocal rank fusion outperforms Condorcet and
    individual rank learning methods", SIGIR 2009.
    """

    def __init__(self, name: str, methods: Sequence[Method]) -> None:
        self.name = name
        self.global_vectors = tuple({v: None for m in methods for v in m.global_vectors})
        self._methods = tuple(methods)
        self.seconds: Mapping[str, float] = {}
        """Of the last query, by method."""

    def build(self, photos: Sequence[BenchPhoto]) -> None:
        for method in self._methods:
            method.build(photos)

    def rank(self, query: BenchPhoto) -> list[Ranked]:
        votes: dict[int, float] = {}
        clock = Stopwatch()
        for number, method in enumerate(self._methods, 1):
            with clock.stage(f"{method.name} {number}"):
                ranking = method.rank(query)
            if isinstance(method, Staged):
                clock.seconds[f"{method.name} {number}"] = sum(method.seconds.values())
            with clock.stage("vote"):
                for place, ranked in enumerate(ranking, 1):
                    vote = 1 / (_DAMPING + place)
                    votes[ranked.image_id] = votes.get(ranked.image_id, 0.0) + vote
        self.seconds = clock.seconds
        return [Ranked(i, vote) for i, vote in sorted(votes.items(), key=lambda item: -item[1])]
