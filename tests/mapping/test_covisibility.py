"""Who sees what, and the tree of photos that share most."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.model_building import model_of

from sfm_front.mapping.covisibility import Covisibility, Sharing, parts

SEEN_BY = [*[["a", "b"]] * 4, *[["b", "c"]] * 2, *[["c", "d"]] * 4, *[["a", "b", "c"]]]


def test_points_are_counted_by_the_photos_that_share_them():
    covisibility = Covisibility.of(model_of(SEEN_BY), min_observers=2)
    assert covisibility.image_ids.tolist() == [1, 2, 3, 4]
    sharing = covisibility.sharing()
    assert sharing.own.tolist() == [5, 7, 7, 4]
    assert [others.tolist() for others in sharing.others] == [[1, 2], [0, 2], [0, 1, 3], [2]]
    assert [counts.tolist() for counts in sharing.counts] == [[5, 1], [5, 3], [1, 3, 4], [4]]
    assert sharing.pairs(3).tolist() == [[0, 1], [2, 3], [1, 2]]
    assert np.count_nonzero(covisibility.seen_by(np.array([True, False, False, True]))) == 9


def test_points_of_few_observers_are_left_out():
    covisibility = Covisibility.of(model_of(SEEN_BY), min_observers=3)
    assert len(covisibility.points) == 1
    assert [len(seen) for seen in covisibility.observed] == [1, 1, 1, 0]


def test_a_chain_is_parted_at_each_of_its_links():
    covisibility = Covisibility.of(model_of(SEEN_BY), min_observers=2)
    found = [parts(covisibility.image_ids, part) for part in covisibility.sharing().halves()]
    assert sorted(map(sorted, found)) == [
        [(1,), (2, 3, 4)],
        [(1, 2), (3, 4)],
        [(1, 2, 3), (4,)],
    ]


@pytest.mark.parametrize("num_photos", [0, 1])
def test_less_than_two_photos_have_no_parts(num_photos):
    alone = tuple(np.zeros(0, np.int64) for _ in range(num_photos))
    sharing = Sharing(np.ones(num_photos, np.int64), alone, alone)
    assert list(sharing.halves()) == []
    assert sharing.pairs(1).shape == (0, 2)
