import numpy as np
import pytest

from sfm_front.geometry.similarity import Similarities
from sfm_front.georeference.control.alignment import Surveyed, align_to_surveyed

SIGMA_M = 0.01


def similarity():
    rotation, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    return Similarities(np.array([7.0]), rotation[None], np.array([[100.0, -50.0, 20.0]]))


def points(count, seed=0):
    """(N, 3) surveyed, in an area of 100 by 80 m with 10 m of relief."""
    return np.random.default_rng(seed).uniform((-50, -40, 0), (50, 40, 10), (count, 3))


def surveyed(enu, has_height=None):
    known = np.ones(len(enu), bool) if has_height is None else has_height
    sigmas = np.full(enu.shape, SIGMA_M)
    sigmas[~known, 2] = 5.0
    return Surveyed(enu, sigmas, known)


def in_model(enu):
    """The same points in the model."""
    return similarity().inverse()(enu)[0]


def aligned(alignment, enu):
    return alignment.enu_from_model(in_model(enu))[0]


@pytest.mark.parametrize("count", [3, 4, 7])
def test_exact_points_give_the_similarity(count):
    enu = points(count)
    alignment = align_to_surveyed(in_model(enu), surveyed(enu))
    assert alignment.agree.all()
    np.testing.assert_allclose(alignment.enu_from_model.scales, 7.0, rtol=1e-9)
    np.testing.assert_allclose(aligned(alignment, points(20, 9)), points(20, 9), atol=1e-6)


@pytest.mark.parametrize("count", [5, 6, 8, 12])
def test_a_wrong_point_is_named_and_moves_nothing(count):
    enu = points(count)
    wrong = enu.copy()
    wrong[1] += (3, -2, 1)
    alignment = align_to_surveyed(in_model(enu), surveyed(wrong))
    assert np.flatnonzero(~alignment.agree).tolist() == [1]
    np.testing.assert_allclose(aligned(alignment, enu), enu, atol=1e-6)


def test_two_points_taken_for_each_other_are_named():
    enu = points(8)
    swapped = enu[[0, 1, 5, 3, 4, 2, 6, 7]]
    alignment = align_to_surveyed(in_model(enu), surveyed(swapped))
    assert np.flatnonzero(~alignment.agree).tolist() == [2, 5]


def test_points_without_height_count_horizontally():
    enu = points(8)
    known = np.arange(8) < 3
    measured = enu.copy()
    measured[~known, 2] = 5.0
    alignment = align_to_surveyed(in_model(enu), surveyed(measured, known))
    assert alignment.agree.all()
    np.testing.assert_allclose(aligned(alignment, enu), enu, atol=0.02)


def test_points_without_any_height_level_the_model():
    enu = points(8) * (1, 1, 0.1)
    measured = enu.copy()
    measured[:, 2] = 0.5
    alignment = align_to_surveyed(in_model(enu), surveyed(measured, np.zeros(8, bool)))
    off = aligned(alignment, enu) - enu
    assert np.abs(off[:, :2]).max() < 0.02
    assert np.abs(off[:, 2]).max() < 1.0


def test_points_on_a_line_or_too_few_give_nothing():
    line = np.array([[0.0, 0, 0], [10, 5, 1], [20, 10, 2], [40, 20, 4]])
    assert align_to_surveyed(in_model(line), surveyed(line)) is None
    assert align_to_surveyed(in_model(points(2)), surveyed(points(2))) is None
