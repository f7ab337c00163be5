"""Which candidates are matched on all features, on photos with known overlap."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from helpers.photo_stream import true_matches, view_of

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.matching.matcher import CpuMatcher
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.matching.verification import Verifier, View
from sfm_front.retrieval.rerank import Reranker, RerankOptions
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.session.pair_matching import CandidateMatcher
from sfm_front.types import Candidate, Features, Uint32Array


class Recorder:
    """A matcher that remembers what it was asked: features of the query, and of how many."""

    def __init__(self, matcher: CpuMatcher) -> None:
        self._matcher = matcher
        self.asked: list[tuple[int, int, bool]] = []

    def match(
        self,
        query: Features,
        others: Sequence[Features],
        rotations_rad: Sequence[float | None],
    ) -> list[Uint32Array]:
        turned = None not in rotations_rad
        self.asked.append((len(query), len(others), turned))
        return self._matcher.match(query, others, rotations_rad)


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    """Photo 1 shares most with photo 0, 6 looks from the other side."""
    return make_scene(12, 600, seed=5, layout="orbit")


@pytest.fixture(scope="module")
def views(orbit) -> dict[int, View]:
    return {index: view_of(orbit, index, index) for index in (0, 1, 2, 6)}


@pytest.fixture
def workers():
    with WorkerPool(1) as workers:
        yield workers


@pytest.fixture
def recorder(workers):
    return Recorder(CpuMatcher(MatchingOptions(), workers))


@pytest.fixture
def pairing_of(recorder, workers):
    """With a second look at so many features."""

    def make(second_rerank: int) -> CandidateMatcher:
        options = RerankOptions(max_features=second_rerank)
        return CandidateMatcher(recorder, Reranker(options, recorder, Verifier(), workers))

    return make


def test_what_is_known_to_be_turned_is_matched_at_once(orbit, views, recorder, pairing_of):
    candidates = [Candidate(1, 0.5, 100, rotation_rad=0.0), Candidate(2, 0.4, 50, rotation_rad=0.0)]
    found = pairing_of(200).match(views[0], candidates, views)
    whole = len(views[0].features)
    assert [asked for asked in recorder.asked if asked[1]] == [(whole, 2, True)]
    assert [view.image_id for view, _ in found] == [1, 2]
    true = {tuple(row) for row in true_matches(orbit, 0, 1).tolist()}
    matches = {tuple(row) for row in found[0][1].tolist()}
    assert len(matches & true) > 0.8 * len(true)


def test_a_stranger_gets_a_second_look_and_no_more(views, recorder, pairing_of):
    found = pairing_of(200).match(views[0], [Candidate(6, 0.5, 5)], views)
    assert found == []
    assert [asked for asked in recorder.asked if asked[1]] == [(200, 1, False)]


def test_the_second_look_finds_what_the_first_missed(views, recorder, pairing_of):
    missed = [Candidate(6, 0.6, 3), Candidate(1, 0.5, 3)]
    (found,) = pairing_of(400).match(views[0], missed, views)
    other, matches = found
    assert other.image_id == 1
    assert len(matches) > 100
    # The second look told the turn: all features are matched accordingly.
    assert recorder.asked[-1] == (len(views[0].features), 1, True)


def test_nothing_to_match_is_nothing(views, pairing_of):
    assert pairing_of(200).match(views[0], [], views) == []
