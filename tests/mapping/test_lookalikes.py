"""Folded models are told from true ones, over scenes with known truth."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.lookalike_walk import NUM_PHOTOS, LookAlikeWalk

from sfm_front.errors import ConfigError
from sfm_front.mapping.lookalikes import FoldOptions, find_fold

SECOND_HALF = set(range(NUM_PHOTOS // 2 + 2, NUM_PHOTOS + 1))


@pytest.fixture(scope="module")
def walk() -> LookAlikeWalk:
    return LookAlikeWalk()


def test_a_true_model_is_not_folded(walk):
    assert find_fold(walk.model(folded=False), walk.view_graph()) is None


def test_a_folded_model_is_parted_where_it_folds(walk):
    parts = find_fold(walk.model(folded=True), walk.view_graph())
    assert parts is not None
    assert SECOND_HALF in [set(part) for part in parts]
    assert sorted(parts[0] + parts[1]) == list(range(1, NUM_PHOTOS + 1))
    assert len(parts[0]) >= len(parts[1])


def test_half_the_photos_of_a_true_model_are_not_folded(walk):
    model = walk.model(folded=False)
    for image_id in range(2, NUM_PHOTOS + 1, 2):
        model.deregister_frame(model.image(image_id).frame_id)
    assert find_fold(model, walk.view_graph()) is None


def test_ends_that_drifted_apart_are_not_folded_where_matches_link_them(walk):
    drifted, graph = walk.model(drift=0.12), walk.view_graph(true_pairs=True)
    assert find_fold(drifted, graph) is None
    # Without the matches between the two ends, all that tells is what each does not see.
    first = set(range(1, NUM_PHOTOS + 1)) - SECOND_HALF
    across = [pair for pair in graph.pairs(graph.image_ids) if len(first & set(pair)) == 1]
    graph.keep_only({pair: np.zeros((0, 2), np.uint32) for pair in across})
    assert find_fold(drifted, graph) is not None


@pytest.mark.parametrize(
    "wrong",
    [{"min_cells": 0}, {"min_share": 0}, {"min_share": 1}, {"min_shared": 0}, {"max_pairs": 0}],
)
def test_options_out_of_range(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        FoldOptions(**wrong)
