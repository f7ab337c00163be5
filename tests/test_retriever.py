"""Coarse and fine retrieval together, on a flight with known overlaps."""

from __future__ import annotations

import pytest
from photo_stream import described, true_matches

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic import make_scene
from sfm_front.features.vlad import Vlad
from sfm_front.matcher import CpuMatcher
from sfm_front.matching import MatchingOptions
from sfm_front.retrieval.rerank import Reranker, RerankOptions
from sfm_front.retrieval.retriever import RetrievalOptions, Retriever
from sfm_front.verification import Verifier, View
from sfm_front.workers import Workers


@pytest.fixture
def retriever():
    """It asks for six candidates."""
    with Workers(1) as workers:
        reranker = Reranker(
            RerankOptions(), CpuMatcher(MatchingOptions(), workers), Verifier(), workers
        )
        yield Retriever(RetrievalOptions(candidates=6), Vlad().dimension, reranker)


def test_the_most_relevant_photo_is_the_one_that_overlaps_most(retriever):
    scene = make_scene(16, 300, seed=8, layout="orbit")
    for index in range(15):
        photo = described(scene, index)
        retriever.remember(View(index, scene.camera, photo.features), photo.global_vector)
    query = described(scene, 15)
    coarse = retriever.candidates(query.global_vector)
    assert len(coarse) == 6
    assert all(-1 <= candidate.cosine <= 1 for candidate in coarse)
    fine = retriever.rerank(View(15, scene.camera, query.features), coarse)
    assert sorted(c.image_id for c in fine) == sorted(c.image_id for c in coarse)
    best = max(range(15), key=lambda index: len(true_matches(scene, 15, index)))
    assert fine[0].image_id == best
    assert [c.inliers for c in fine] == sorted((c.inliers for c in fine), reverse=True)


def test_the_first_photo_has_no_candidates(retriever):
    scene = make_scene(2, 50, seed=9)
    photo = described(scene, 0)
    assert retriever.candidates(photo.global_vector) == []
    assert retriever.rerank(View(1, scene.camera, photo.features), []) == []


def test_no_candidates_asked_for_is_refused():
    with pytest.raises(ConfigError, match="candidates must be at least 1, got 0"):
        RetrievalOptions(candidates=0)


@pytest.mark.parametrize("wrong", [{"candidates": 0}, {"widen_by": -1}])
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        RetrievalOptions(**wrong)
