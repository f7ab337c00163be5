"""Who sees what, and the tree of photos that share most."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from helpers.model_building import model_of

from sfm_front.mapping.covisibility import Covisibility, halves, parts

SEEN_BY = [*[["a", "b"]] * 4, *[["b", "c"]] * 2, *[["c", "d"]] * 4, *[["a", "b", "c"]]]


def test_points_are_counted_by_the_photos_that_share_them():
    covisibility = Covisibility.of(model_of(SEEN_BY), min_observers=2)
    assert covisibility.image_ids.tolist() == [1, 2, 3, 4]
    assert covisibility.num_shared().tolist() == [
        [5, 5, 1, 0],
        [5, 7, 3, 0],
        [1, 3, 7, 4],
        [0, 0, 4, 4],
    ]
    assert np.count_nonzero(covisibility.seen_by(np.array([True, False, False, True]))) == 9


def test_points_of_few_observers_are_left_out():
    covisibility = Covisibility.of(model_of(SEEN_BY), min_observers=3)
    assert len(covisibility.points) == 1
    assert [len(seen) for seen in covisibility.observed] == [1, 1, 1, 0]


def test_a_chain_is_parted_at_each_of_its_links():
    covisibility = Covisibility.of(model_of(SEEN_BY), min_observers=2)
    found = [parts(covisibility.image_ids, part) for part in halves(covisibility.num_shared())]
    assert sorted(map(sorted, found)) == [
        [(1,), (2, 3, 4)],
        [(1, 2), (3, 4)],
        [(1, 2, 3), (4,)],
    ]


@pytest.mark.parametrize("num_photos", [0, 1])
def test_less_than_two_photos_have_no_parts(num_photos):
    assert list(halves(np.ones((num_photos, num_photos), np.int64))) == []


def test_the_tree_takes_less_memory_than_what_it_is_made_of():
    number = np.arange(1500)
    num_shared = np.maximum(0, 20 - np.abs(number[:, None] - number))
    tracemalloc.start()
    try:
        *_, last = halves(num_shared)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert np.count_nonzero(last) in (1, len(number) - 1)
    assert peak < num_shared.nbytes / 2
