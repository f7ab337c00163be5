"""Which candidates are matched on all features, on photos with known overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from helpers.photo_stream import true_matches, view_of

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.matching.guided_matching import GuidedMatcher, GuidedOptions
from sfm_front.matching.matcher import CpuMatcher
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.matching.verification import VerificationOptions, Verifier
from sfm_front.retrieval.rerank import Reranker, RerankOptions
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.session.pair_matching import CandidateMatcher, PairMatchingOptions
from sfm_front.types import Features, RankedCandidate, Rejection, Uint32Array, View


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
        verifier = Verifier()
        reranker = Reranker(RerankOptions(max_features=second_rerank), recorder, verifier, workers)
        guided = GuidedMatcher(GuidedOptions(), MatchingOptions(), VerificationOptions(), workers)
        options = PairMatchingOptions()
        return CandidateMatcher(options, recorder, reranker, verifier, guided, workers)

    return make


def ranked(image_id: int, inliers: int, rotation_rad: float | None = None) -> RankedCandidate:
    return RankedCandidate(image_id, 0.5, inliers, rotation_rad, np.zeros((inliers, 2), np.uint32))


def test_what_is_known_to_be_turned_is_matched_at_once(orbit, views, recorder, pairing_of):
    candidates = [ranked(1, 100, rotation_rad=0.0), ranked(2, 50, rotation_rad=0.0)]
    found, rejected = pairing_of(200).tentative_matches(views[0], candidates, views)
    assert rejected == {}
    whole = len(views[0].features)
    assert [asked for asked in recorder.asked if asked[1]] == [(whole, 2, True)]
    assert [view.image_id for view, _ in found] == [1, 2]
    true = {tuple(row) for row in true_matches(orbit, 0, 1).tolist()}
    matches = {tuple(row) for row in found[0][1].tolist()}
    assert len(matches & true) > 0.8 * len(true)


def test_a_stranger_gets_a_second_look_and_no_more(views, recorder, pairing_of):
    found, rejected = pairing_of(200).tentative_matches(views[0], [ranked(6, 5)], views)
    assert found == []
    assert list(rejected) == [6]
    assert rejected[6].reason is Rejection.UNLIKELY
    assert rejected[6].num_matches is None
    assert rejected[6].num_inliers < PairMatchingOptions().min_inliers
    assert [asked for asked in recorder.asked if asked[1]] == [(200, 1, False)]


def test_the_second_look_finds_what_the_first_missed(views, recorder, pairing_of):
    missed = [ranked(6, 3), ranked(1, 3)]
    (found,), rejected = pairing_of(400).tentative_matches(views[0], missed, views)
    assert list(rejected) == [6]
    other, matches = found
    assert other.image_id == 1
    assert len(matches) > 100
    # The second look told the turn: all features are matched accordingly.
    assert recorder.asked[-1] == (len(views[0].features), 1, True)


def test_nothing_to_match_is_nothing(views, pairing_of):
    assert pairing_of(200).tentative_matches(views[0], [], views) == ([], {})


def test_the_pose_that_the_first_pairs_tell_guides_the_rest(orbit, views, pairing_of):
    """Without one, all are matched unguided; either way each candidate gets one verdict."""
    candidates = [
        RankedCandidate(image_id, 0.5, len(matches), 0.0, matches)
        for image_id in (1, 2)
        for matches in [true_matches(orbit, 0, image_id)]
    ]
    one_first = replace_options(pairing_of(200), num_matched_first=1)
    asked = []

    def locate(view, pairs):
        asked.append((view.image_id, [pair.image_id2 for pair in pairs]))
        return orbit_pose(orbit, 0)

    def poses_of(image_ids):
        return {image_id: orbit_pose(orbit, image_id) for image_id in image_ids}

    clock = Stopwatch()
    pairs, rejected = one_first.match(
        views[0], candidates, views, locate=locate, poses_of=poses_of, clock=clock
    )
    assert asked == [(0, [1])]
    assert [pair.image_id2 for pair in pairs] == [1, 2]
    assert rejected == {}
    assert clock.seconds.keys() >= {"match", "verify", "locate", "guide"}


def test_a_rejected_pair_tells_why_and_how_many(views, pairing_of):
    stranger = ranked(6, 100, rotation_rad=1.0)
    pairs, rejected = pairing_of(200).match(
        views[0],
        [stranger],
        views,
        locate=lambda _view, _pairs: None,
        poses_of=lambda _ids: {},
        clock=Stopwatch(),
    )
    assert pairs == []
    assert rejected[6].reason in (Rejection.TOO_FEW_MATCHES, Rejection.NO_EPIPOLAR_GEOMETRY)
    assert rejected[6].num_matches is not None
    assert rejected[6].num_inliers < 15


@pytest.mark.parametrize("name", ["num_matched", "num_matched_first", "min_inliers"])
def test_numbers_below_one_are_refused(name):
    with pytest.raises(ConfigError, match=f"{name} must be at least 1, got 0"):
        PairMatchingOptions(**{name: 0})


def replace_options(matcher: CandidateMatcher, **options: int) -> CandidateMatcher:
    matcher._options = replace(matcher._options, **options)
    return matcher


def orbit_pose(orbit: SyntheticScene, index: int) -> PosedCamera:
    return PosedCamera(orbit.camera, orbit.cams_from_world[index])
