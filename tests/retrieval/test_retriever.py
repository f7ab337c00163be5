"""Coarse and fine retrieval together, on a flight with known overlaps."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.photo_stream import described, true_matches

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.matching.matcher import CpuMatcher
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.matching.verification import Verifier
from sfm_front.retrieval.index import IndexOptions
from sfm_front.retrieval.rerank import Reranker, RerankOptions
from sfm_front.retrieval.retriever import RetrievalOptions, Retriever
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.types import RankedCandidate, View

COSINE_TOLERANCE = 0.01


@pytest.fixture
def retriever():
    """It asks for six candidates."""
    return Retriever(RetrievalOptions(candidates=6), Vlad().dimension)


@pytest.fixture
def reranker():
    with WorkerPool(1) as workers:
        yield Reranker(RerankOptions(), CpuMatcher(MatchingOptions(), workers), Verifier(), workers)


def test_the_most_relevant_photo_is_the_one_that_overlaps_most(retriever, reranker):
    scene = make_scene(16, 300, seed=8, layout="orbit")
    views = {}
    for index in range(15):
        photo = described(scene, index)
        views[index] = View(index, scene.camera, photo.features)
        retriever.remember(index, photo.global_vector)
    assert len(retriever) == 15
    query = described(scene, 15)
    coarse = retriever.candidates(query.global_vector)
    assert len(coarse) == 6
    assert all(-1 <= candidate.cosine <= 1 for candidate in coarse)
    fine = reranker.rerank(View(15, scene.camera, query.features), coarse, views)
    assert sorted(c.image_id for c in fine) == sorted(c.image_id for c in coarse)
    best = max(range(15), key=lambda index: len(true_matches(scene, 15, index)))
    assert fine[0].image_id == best
    assert [c.inliers for c in fine] == sorted((c.inliers for c in fine), reverse=True)


def test_the_first_photo_has_no_candidates(retriever):
    scene = make_scene(2, 50, seed=9)
    photo = described(scene, 0)
    assert retriever.candidates(photo.global_vector) == []
    assert retriever.rank(photo.global_vector, [], min_inliers=15) == []


def unit(*numbers: float) -> np.ndarray:
    vector = np.zeros(Vlad().dimension, np.float32)
    vector[: len(numbers)] = numbers
    return vector / np.linalg.norm(vector)


def ranked(image_id: int, cosine: float, inliers: int) -> RankedCandidate:
    return RankedCandidate(image_id, cosine, inliers, None, np.zeros((inliers, 2), np.uint32))


def test_of_the_others_those_like_the_verified_photos_come_first(retriever):
    """Photo 1 was verified, 2 is like it, 3 is a little more like the query alone."""
    query = unit(1, 0, 0, 0)
    for image_id, vector in enumerate(
        [unit(1, 2, 0, 0), unit(1, 3, 0, 0), unit(1, 0, 2.5, 0), unit(0, 0, 0, 1)], 1
    ):
        retriever.remember(image_id, vector)
    looked = [ranked(1, 0.447, 40), ranked(3, 0.371, 14)]
    found = retriever.rank(query, looked, min_inliers=15)
    assert [c.image_id for c in found] == [1, 2, 3, 4]
    assert [c.inliers for c in found] == [40, None, 14, None]
    assert found[1].cosine == pytest.approx(1 / 10**0.5, abs=COSINE_TOLERANCE)


def test_where_none_was_verified_the_best_by_cosine_stand_in(retriever):
    query = unit(1, 0, 0)
    for image_id, vector in enumerate([unit(1, 2, 0), unit(1, 3, 0), unit(1, 0, 2.5)], 1):
        retriever.remember(image_id, vector)
    (*first,) = retriever.candidates(query)
    found = retriever.rank(query, [ranked(1, 0.447, 14)], min_inliers=15)
    assert [c.image_id for c in found] == [c.image_id for c in first]
    assert found[[c.image_id for c in found].index(1)].inliers == 14


def test_it_hands_its_options_to_the_index():
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(400, 64)).astype(np.float32)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    nearest = set(np.argsort(-(vectors @ vectors[0]))[:10])
    found = []
    for shortlist in (len(vectors), 1):
        options = RetrievalOptions(
            candidates=10,
            num_expansion=0,
            index=IndexOptions(shortlist=shortlist, shortlist_growth=0),
        )
        retriever = Retriever(options, 64)
        for image_id, vector in enumerate(vectors):
            retriever.remember(image_id, vector)
        found.append({c.image_id for c in retriever.candidates(vectors[0])})
    assert found[0] == nearest != found[1]


def test_no_candidates_asked_for_is_refused():
    with pytest.raises(ConfigError, match="candidates must be at least 1, got 0"):
        RetrievalOptions(candidates=0)


@pytest.mark.parametrize("wrong", [{"candidates": 0}, {"num_expansion": -1}])
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        RetrievalOptions(**wrong)
