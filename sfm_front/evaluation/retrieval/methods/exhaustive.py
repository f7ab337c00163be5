"""The reference: match the query with every photo, on all features, and verify."""

from __future__ import annotations

from collections.abc import Sequence

from sfm_front.evaluation.retrieval.types import BenchPhoto, Ranked
from sfm_front.matching.nearest_neighbors import MatchingOptions, match_descriptors
from sfm_front.matching.verification import Verifier
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.types import View


class Exhaustive:
    """Ranks by the SIFT matches that survive RANSAC on a fundamental matrix, then by matches."""

    name = "exhaustive"
    global_vectors = ()

    def __init__(self, workers: WorkerPool) -> None:
        self._matching = MatchingOptions()
        self._verifier = Verifier()
        self._workers = workers

    def build(self, photos: Sequence[BenchPhoto]) -> None:
        self._views = [photo.view for photo in photos]

    def rank(self, query: BenchPhoto) -> list[Ranked]:
        def compare(other: View) -> Ranked:
            matches = match_descriptors(
                query.view.features.descriptors, other.features.descriptors, self._matching
            )
            inliers = self._verifier.count_inliers(query.view, other, matches)
            # Matches count less than one inlier in total: they only break ties.
            tie_break = len(matches) / (1000 * (1 + len(query.view.features)))
            return Ranked(other.image_id, inliers + tie_break, inliers=inliers)

        return sorted(self._workers.map(compare, self._views), key=lambda r: -r.score)
