"""Similarities between sets of points."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest

from sfm_front.geometry.similarity import Similarities

TRUE = [
    pycolmap.Sim3d(2.5, pycolmap.Rotation3d([0.3, -0.2, 0.1]), [5.0, -1.0, 2.0]),
    pycolmap.Sim3d(0.1, pycolmap.Rotation3d([0.0, 3.0, 0.4]), [0.0, 7.0, 0.0]),
]
POINTS = np.random.default_rng(0).normal(size=(2, 6, 3))


@pytest.fixture
def fitted() -> Similarities:
    moved = [true * points for true, points in zip(TRUE, POINTS, strict=True)]
    return Similarities.between(POINTS, np.array(moved))


def test_each_set_of_points_yields_the_similarity_that_moved_it(fitted):
    assert len(fitted) == 2
    for number, true in enumerate(TRUE):
        np.testing.assert_allclose(fitted[number].only().matrix(), true.matrix(), atol=1e-9)


def test_points_are_moved_by_each_and_back(fitted):
    moved = fitted(POINTS[0])
    for number, true in enumerate(TRUE):
        np.testing.assert_allclose(moved[number], true * POINTS[0], atol=1e-9)
        back = fitted[number].inverse()(moved[number])
        np.testing.assert_allclose(back[0], POINTS[0], atol=1e-9)


def test_a_mirrored_set_is_turned_and_not_mirrored():
    fitted = Similarities.between(POINTS[:1], POINTS[:1] * (1.0, 1.0, -1.0))
    assert np.linalg.det(fitted.rotations[0]) == pytest.approx(1)


def test_points_that_coincide_yield_nothing_without_complaint():
    same = np.ones((1, 3, 3))
    assert not np.isfinite(Similarities.between(same, same)(np.ones((2, 3)))).any()


def test_similarities_of_pycolmap_and_of_several_parts_are_the_same():
    parts = [Similarities.of(TRUE[:1]), Similarities.of(TRUE[1:])]
    joined = Similarities.joined(parts)
    assert len(joined) == 2
    for number, true in enumerate(TRUE):
        np.testing.assert_allclose(joined[number].only().matrix(), true.matrix(), atol=1e-12)
