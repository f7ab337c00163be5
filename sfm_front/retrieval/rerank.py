"""Fine retrieval: re-order candidates by SIFT matches that survive RANSAC."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sfm_front.errors import ConfigError
from sfm_front.matching.in_plane_rotation import RotationOptions, in_plane_rotation
from sfm_front.matching.matcher import Matcher
from sfm_front.matching.verification import Verifier
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.types import Candidate, RankedCandidate, Uint32Array, View


@dataclass(frozen=True, kw_only=True)
class RerankOptions:
    """How closely each candidate is looked at."""

    # Features matched per photo, largest scale first.
    max_features: int = 800
    # Candidates matched at a time. After each batch re-ranking may stop, which spares a third of
    # the work and keeps the best (TUNING: rerank-batch).
    batch_size: int = 12
    # Inliers from which a candidate is good; it stops once enough are (TUNING: rerank-batch).
    good_inliers: int = 30

    def __post_init__(self) -> None:
        if self.max_features < 8:
            raise ConfigError(f"rerank max_features must be at least 8, got {self.max_features}")
        for name in ("batch_size", "good_inliers"):
            if getattr(self, name) < 1:
                raise ConfigError(f"rerank {name} must be at least 1, got {getattr(self, name)}")


class Reranker:
    """Counts verified matches between a query and each of its candidates."""

    def __init__(
        self,
        options: RerankOptions,
        matcher: Matcher,
        verifier: Verifier,
        workers: WorkerPool,
        *,
        rotation: RotationOptions | None = None,
    ) -> None:
        self._options = options
        self._rotation = rotation or RotationOptions()
        self._matcher = matcher
        self._verifier = verifier
        self._workers = workers

    def rerank(
        self,
        query: View,
        candidates: Sequence[Candidate | RankedCandidate],
        views: Mapping[int, View],
        *,
        enough: int | None = None,
    ) -> list[RankedCandidate]:
        """Candidates by inliers, ties by cosine; the first is the most relevant photo.

        They are matched in batches, in the order given. Once ``enough`` are good, the remaining
        ones are left out.
        """
        options = self._options
        looked_at: list[RankedCandidate] = []
        for start in range(0, len(candidates), options.batch_size):
            looked_at += self._count(query, candidates[start : start + options.batch_size], views)
            good = sum(candidate.inliers >= options.good_inliers for candidate in looked_at)
            if enough is not None and good >= enough:
                break
        return sorted(looked_at, key=lambda c: (-c.inliers, -c.cosine))

    def _count(
        self,
        query: View,
        candidates: Sequence[Candidate | RankedCandidate],
        views: Mapping[int, View],
    ) -> list[RankedCandidate]:
        limit = self._options.max_features
        matches = self._matcher.match(
            query.features.largest(limit),
            [views[candidate.image_id].features.largest(limit) for candidate in candidates],
            [None] * len(candidates),
        )

        def verify(tentative: tuple[Candidate | RankedCandidate, Uint32Array]) -> RankedCandidate:
            candidate, tentative_matches = tentative
            view = views[candidate.image_id]
            inliers = self._verifier.inliers(query, view, tentative_matches)
            rotation_rad = in_plane_rotation(
                query.features.keypoints[inliers[:, 0]],
                view.features.keypoints[inliers[:, 1]],
                self._rotation,
            )
            return RankedCandidate(
                candidate.image_id, candidate.cosine, len(inliers), rotation_rad, inliers
            )

        return self._workers.map(verify, zip(candidates, matches, strict=True))
