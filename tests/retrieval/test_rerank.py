"""Re-ranking by verified matches, on photos with known overlap."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

import pytest
from helpers.photo_stream import no_features, true_matches, view_of

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.matching.in_plane_rotation import RotationOptions
from sfm_front.matching.matcher import CpuMatcher
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.matching.verification import Verifier
from sfm_front.retrieval.rerank import Reranker, RerankOptions
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.types import Candidate, View

QUERY = 0
OTHERS = (1, 2, 3, 6)


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    """Photo 1 shares most with photo 0, 2 less, 3 little, 6 looks from the other side."""
    return make_scene(12, 500, seed=5, layout="orbit")


@pytest.fixture(scope="module")
def views(orbit) -> dict[int, View]:
    return {index: view_of(orbit, index, index) for index in (QUERY, *OTHERS)}


@pytest.fixture
def make_reranker():
    """A re-ranker with these options, on threads that end with the test."""
    with ExitStack() as stack:

        def make(
            num_threads: int = 1, rotation: RotationOptions | None = None, **options: int
        ) -> Reranker:
            workers = stack.enter_context(WorkerPool(num_threads))
            return Reranker(
                RerankOptions(**options),
                CpuMatcher(MatchingOptions(), workers),
                Verifier(),
                workers,
                rotation=rotation,
            )

        yield make


def test_the_candidate_that_shares_most_comes_first(orbit, views, make_reranker):
    # Cosines that say the opposite of the truth.
    candidates = [Candidate(index, 0.1 * index) for index in reversed(OTHERS)]
    ranked = make_reranker().rerank(views[QUERY], candidates, views)
    shared = {index: len(true_matches(orbit, QUERY, index)) for index in OTHERS}
    assert shared[1] > shared[2] > shared[3] > shared[6]
    assert [candidate.image_id for candidate in ranked] == list(OTHERS)
    assert {c.image_id: c.cosine for c in ranked} == {c.image_id: c.cosine for c in candidates}
    for candidate in ranked[:2]:
        assert candidate.inliers == pytest.approx(shared[candidate.image_id], rel=0.1)
    assert ranked[-1].inliers < 15


def test_threads_do_not_change_the_ranking(views, make_reranker):
    candidates = [Candidate(index, 0.5) for index in OTHERS]
    alone = make_reranker().rerank(views[QUERY], candidates, views)
    assert make_reranker(num_threads=3).rerank(views[QUERY], candidates, views) == alone


def test_only_the_strongest_features_are_matched(views, make_reranker):
    candidates = [Candidate(1, 0.5)]
    (few,) = make_reranker(max_features=150).rerank(views[QUERY], candidates, views)
    (many,) = make_reranker().rerank(views[QUERY], candidates, views)
    assert 15 < few.inliers <= 150
    assert few.inliers < many.inliers
    cut = {i: replace(view, features=view.features.largest(150)) for i, view in views.items()}
    assert make_reranker().rerank(cut[QUERY], candidates, cut) == [few]


def test_equals_are_ordered_by_cosine(views, make_reranker):
    blank = View(20, views[QUERY].camera, no_features())
    candidates = [Candidate(20, 0.3), Candidate(21, 0.9), Candidate(22, 0.6)]
    among = dict.fromkeys((20, 21, 22), blank)
    ranked = make_reranker().rerank(views[QUERY], candidates, among)
    assert [(c.image_id, c.inliers) for c in ranked] == [(21, 0), (22, 0), (20, 0)]


@pytest.mark.parametrize(
    ("options", "enough", "looked_at"),
    [
        ({}, 8, 12),
        ({}, 13, 20),
        ({}, None, 20),
        ({"batch_size": 5}, 8, 10),
        ({"batch_size": 5, "good_inliers": 10_000}, 8, 20),
    ],
)
def test_it_stops_once_enough_are_good(views, make_reranker, options, enough, looked_at):
    """All are photo 1; those that were not looked at are left out."""
    candidates = [Candidate(100 + index, 0.5 - 0.01 * index) for index in range(20)]
    among = {candidate.image_id: views[1] for candidate in candidates}
    ranked = make_reranker(**options).rerank(views[QUERY], candidates, among, enough=enough)
    assert [c.image_id for c in ranked] == [c.image_id for c in candidates][:looked_at]


def test_it_goes_on_where_they_are_not(views, make_reranker):
    candidates = [Candidate(100 + index, 0.5) for index in range(14)]
    among = {candidate.image_id: views[6] for candidate in candidates}
    ranked = make_reranker().rerank(views[QUERY], candidates, among, enough=1)
    assert len(ranked) == 14


def test_nothing_to_rank_is_nothing(views, make_reranker):
    assert make_reranker().rerank(views[QUERY], [], views) == []


def test_too_few_features_for_a_fundamental_matrix_are_refused():
    with pytest.raises(ConfigError, match="max_features must be at least 8, got 7"):
        RerankOptions(max_features=7)


@pytest.mark.parametrize("name", ["batch_size", "good_inliers"])
def test_values_out_of_range_are_refused_by_name(name):
    with pytest.raises(ConfigError, match=f"rerank {name} must be at least 1, got 0"):
        RerankOptions(**{name: 0})


def test_features_are_matched_by_descriptor_not_by_place(orbit, views, make_reranker):
    """A photo turned upside down is as relevant as before."""
    view = views[1]
    turned = view.features.keypoints.copy()
    turned[:, :2] = (orbit.camera.width, orbit.camera.height) - turned[:, :2]
    upside_down = replace(view, features=replace(view.features, keypoints=turned))
    (upright,) = make_reranker().rerank(views[QUERY], [Candidate(1, 0.5)], {1: view})
    (flipped,) = make_reranker().rerank(views[QUERY], [Candidate(1, 0.5)], {1: upside_down})
    assert flipped.inliers == pytest.approx(upright.inliers, rel=0.1)


def test_it_tells_how_far_candidates_are_turned(views, make_reranker):
    view = views[1]
    keypoints = view.features.keypoints.copy()
    keypoints[:, 3] += 1.0
    turned = replace(view, features=replace(view.features, keypoints=keypoints))
    (upright,) = make_reranker().rerank(views[QUERY], [Candidate(1, 0.5)], {1: view})
    (further,) = make_reranker().rerank(views[QUERY], [Candidate(1, 0.5)], {1: turned})
    assert upright.rotation_rad is not None
    assert further.rotation_rad - upright.rotation_rad == pytest.approx(1.0, abs=0.01)
    (stranger,) = make_reranker().rerank(views[QUERY], [Candidate(6, 0.5)], views)
    assert stranger.rotation_rad is None
    strict = make_reranker(rotation=RotationOptions(min_matches=upright.inliers + 1))
    (unsure,) = strict.rerank(views[QUERY], [Candidate(1, 0.5)], {1: view})
    assert (unsure.inliers, unsure.rotation_rad) == (upright.inliers, None)
