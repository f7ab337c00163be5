"""Which candidates a photo is matched with on all features, and how."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from sfm_front.errors import ConfigError
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.matching.guided_matching import GuidedMatcher
from sfm_front.matching.matcher import Matcher
from sfm_front.matching.verification import Verifier
from sfm_front.retrieval.rerank import Reranker
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.types import (
    Candidate,
    CandidateOutcome,
    PairGeometry,
    RankedCandidate,
    Rejected,
    Rejection,
    Uint32Array,
    View,
)

logger = logging.getLogger(__name__)

Locate = Callable[[View, Sequence[PairGeometry]], "PosedCamera | None"]
"""A photo's camera and pose in the model, by its first verified pairs; None if they do not tell."""

PosesOf = Callable[[Iterable[int]], Mapping[int, PosedCamera]]
"""Cameras and poses of those of these photos that are in the model."""


@dataclass(frozen=True, kw_only=True)
class PairMatchingOptions:
    """Which candidates are matched on all features."""

    # Re-ranked photos that are matched.
    num_matched: int = 8
    # Number of top candidates matched without guidance; the pose they yield guides the rest.
    num_matched_first: int = 3
    # Inliers of the second re-ranking below which matching all features never pays
    # (TUNING: rerank-floor).
    min_inliers: int = 11

    def __post_init__(self) -> None:
        for name in ("num_matched", "num_matched_first", "min_inliers"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be at least 1, got {getattr(self, name)}")


class CandidateMatcher:
    """Matches the best candidates on all features, and verifies.

    The first few are matched without guidance. If their verified pairs tell the photo's pose in
    the model, the rest are matched along epipolar planes; those without a known pose are not.
    """

    def __init__(
        self,
        options: PairMatchingOptions,
        matcher: Matcher,
        second_reranker: Reranker,
        verifier: Verifier,
        guided: GuidedMatcher,
        workers: WorkerPool,
    ) -> None:
        self._options = options
        self._matcher = matcher
        self._second_reranker = second_reranker
        self._verifier = verifier
        self._guided = guided
        self._workers = workers

    def match(
        self,
        query: View,
        candidates: Sequence[RankedCandidate],
        views: Mapping[int, View],
        *,
        locate: Locate,
        poses_of: PosesOf,
        clock: Stopwatch,
    ) -> tuple[list[PairGeometry], dict[int, Rejected]]:
        """Candidates as re-ranked → verified pairs, and why others that were tried have none, by
        image id."""
        num_first = self._options.num_matched_first
        chosen = candidates[: self._options.num_matched]
        first, rest = chosen[:num_first], chosen[num_first:]
        pairs, rejected = self._match_unguided(query, first, views, clock)
        if rest:
            with clock.stage("locate"):
                posed = locate(query, pairs)
            if posed is not None:
                with clock.stage("guide"):
                    others = poses_of(candidate.image_id for candidate in rest)
                    guided = self._guided.match(query, posed, rest, views, others)
                pairs += guided
                found = {pair.image_id2 for pair in guided}
                rest = [candidate for candidate in rest if candidate.image_id not in found]
            more, more_rejected = self._match_unguided(query, rest, views, clock)
            pairs += more
            rejected |= more_rejected
        _log(query, pairs, rejected)
        return pairs, rejected

    def _match_unguided(
        self,
        query: View,
        candidates: Sequence[RankedCandidate],
        views: Mapping[int, View],
        clock: Stopwatch,
    ) -> tuple[list[PairGeometry], dict[int, Rejected]]:
        with clock.stage("match"):
            tentative, dismissed = self.tentative_matches(query, candidates, views)

        def verify(pair: tuple[View, Uint32Array]) -> PairGeometry | Rejected:
            return self._verifier.verify(query, *pair)

        with clock.stage("verify"):
            verdicts = self._workers.map(verify, tentative)
        pairs = [verdict for verdict in verdicts if isinstance(verdict, PairGeometry)]
        rejected = {
            other.image_id: verdict
            for (other, _), verdict in zip(tentative, verdicts, strict=True)
            if isinstance(verdict, Rejected)
        }
        return pairs, dismissed | rejected

    def tentative_matches(
        self, query: View, candidates: Sequence[RankedCandidate], views: Mapping[int, View]
    ) -> tuple[list[tuple[View, Uint32Array]], dict[int, Rejected]]:
        """Those likely to be verified, in their order, with their matches (K, 2); and the others.

        If re-ranking told a candidate's in-plane rotation, only features that agree with it are
        matched. If not, a second re-ranking on more features decides whether to match at all.
        """
        doubtful = [candidate for candidate in candidates if candidate.rotation_rad is None]
        again = {c.image_id: c for c in self._second_reranker.rerank(query, doubtful, views)}
        known = [again.get(candidate.image_id, candidate) for candidate in candidates]
        likely = [
            candidate
            for candidate in known
            if candidate.rotation_rad is not None or candidate.inliers >= self._options.min_inliers
        ]
        chosen = {candidate.image_id for candidate in likely}
        dismissed = {
            candidate.image_id: Rejected(Rejection.UNLIKELY, None, candidate.inliers)
            for candidate in known
            if candidate.image_id not in chosen
        }
        others = [views[candidate.image_id] for candidate in likely]
        matches = self._matcher.match(
            query.features,
            [other.features for other in others],
            [candidate.rotation_rad for candidate in likely],
        )
        return list(zip(others, matches, strict=True)), dismissed


def _log(query: View, pairs: Sequence[PairGeometry], rejected: Mapping[int, Rejected]) -> None:
    for pair in pairs:
        logger.debug(
            "images %d and %d: verified, %d of %d matches are inliers",
            *(pair.image_id1, pair.image_id2, pair.num_inliers, len(pair.matches)),
        )
    for image_id, why in rejected.items():
        logger.debug("images %d and %d: %s", query.image_id, image_id, why)


def candidate_outcomes(
    candidates: Iterable[RankedCandidate | Candidate],
    pairs: Iterable[PairGeometry],
    rejected: Mapping[int, Rejected],
    name_of: Callable[[int], str],
) -> tuple[CandidateOutcome, ...]:
    """What became of each candidate of a photo, in their order. ``name_of``: by image id."""
    verified = {pair.image_id2 for pair in pairs}
    return tuple(
        CandidateOutcome(
            name_of(candidate.image_id),
            candidate.cosine,
            candidate.inliers,
            candidate.image_id in verified,
            rejected.get(candidate.image_id),
        )
        for candidate in candidates
    )
