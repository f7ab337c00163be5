"""Which photos are computed with: those that see most in common."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from sfm_front.mapping.observation_sample import close_photos

MIB = 2**20


def chosen_by_matrix(photo: np.ndarray, point: np.ndarray, shape: tuple[int, int]) -> list[int]:
    """The same by a matrix of all photos and points."""
    sees = np.zeros(shape, np.bool_)
    sees[photo, point] = True
    common = np.ones(shape[1], np.bool_)
    chosen: list[int] = []
    for _ in range(50):
        shared = (sees & common).sum(axis=1)
        shared[chosen] = -1
        best = int(shared.argmax())
        if shared[best] <= 0:
            break
        common = common | sees[best] if chosen else sees[best]
        chosen.append(best)
    return chosen


@pytest.mark.parametrize("seed", range(5))
def test_each_shares_most_with_those_before_it(seed):
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(51, 120)), int(rng.integers(10, 400)))
    # Some observe a point twice, and some nothing.
    photo = rng.integers(0, shape[0] - 3, 3000)
    point = rng.integers(0, shape[1], 3000)
    assert close_photos(photo, point, *shape) == chosen_by_matrix(photo, point, shape)


def test_photos_that_share_nothing_are_left_out():
    photo, point = np.array([0, 0, 0, 1, 1, 2, 2]), np.array([0, 1, 2, 2, 3, 4, 5])
    assert close_photos(photo, point, 3, 6) == [0, 1]


def test_a_long_flight_takes_little_memory():
    num_photos, num_points = 10_000, 900_000
    rng = np.random.default_rng(0)
    point = np.repeat(np.arange(num_points), 3)
    photo = (point // 90 + rng.integers(0, 6, len(point))) % num_photos
    tracemalloc.start()
    try:
        assert len(close_photos(photo, point, num_photos, num_points)) == 50
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 400 * MIB  # a matrix of single bits would take 1000
