"""How far cameras moved against each other."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest

from sfm_front.mapping.camera_motion import camera_motion

PLACES = {i: np.random.default_rng(i).normal(size=3) for i in range(1, 21)}


def test_a_model_moved_as_a_whole_has_not_moved():
    by = pycolmap.Sim3d(2.5, pycolmap.Rotation3d([0.3, -0.2, 0.1]), [5.0, -1.0, 2.0])
    after = {i: by * place for i, place in PLACES.items()}
    assert camera_motion(PLACES, after) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_one_that_moved_alone_is_seen_in_units_of_before():
    by = pycolmap.Sim3d(10.0, pycolmap.Rotation3d(), [0.0, 0.0, 0.0])
    after = {i: by * place for i, place in PLACES.items()}
    after[7] = by * (PLACES[7] + np.array([0.0, 0.0, 1.0]))
    median, largest = camera_motion(PLACES, after)
    # The similarity gives way a little to the one that moved.
    assert largest == pytest.approx(1.0, abs=0.3)
    assert median < 0.15


def test_photos_of_one_side_only_do_not_count():
    after = {i: place for i, place in PLACES.items() if i != 3} | {99: np.ones(3)}
    assert camera_motion(PLACES, after) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert camera_motion({1: np.zeros(3)}, {1: np.ones(3)}) == (0.0, 0.0)
    assert camera_motion({}, {}) == (0.0, 0.0)


def test_places_on_a_line_are_compared_as_they_are():
    line = {i: np.array([float(i), 0.0, 0.0]) for i in range(4)}
    moved = {i: place + np.array([0.0, 2.0, 0.0]) for i, place in line.items()}
    assert camera_motion(line, moved) == (2.0, 2.0)
