import numpy as np
import pytest
from helpers.model_building import looking, make_model

from sfm_front.georeference.control.triangulation import Sighting, triangulate

TARGET = np.array([0.3, 10.0, -0.2])
NOISE_PX = 0.3
MAX_ERROR_PX = 4.0


@pytest.fixture
def sightings():
    """Of the target from six places, exact."""
    places = [(-3, 0, 0), (-2, 0, 1), (-1, 0, -1), (1, 0, 1), (2, 0, 0), (3, 0, -1)]
    poses = {f"{i}.jpg": looking(place, (0, 1, 0), (0, 0, 1)) for i, place in enumerate(places)}
    model = make_model(poses)
    return [
        Sighting(model.image(i), model.image(i).project_point(TARGET))
        for i in model.reg_image_ids()
    ]


def marked(sightings, *shifts):
    """With marks moved by pixels: (number, x, y)."""
    moved = list(sightings)
    for number, x, y in shifts:
        moved[number] = Sighting(moved[number].image, moved[number].xy + np.array([x, y]))
    return moved


def test_exact_marks_meet(sightings):
    place = triangulate(sightings, MAX_ERROR_PX)
    np.testing.assert_allclose(place.xyz, TARGET, atol=1e-6)
    assert place.agree.all()
    assert np.abs(place.residuals_px).max() < 1e-4


def test_the_covariance_says_how_far_noise_moves_the_place(sightings):
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(300):
        noise = rng.normal(0, NOISE_PX, (len(sightings), 2))
        moved = marked(sightings, *((i, *shift) for i, shift in enumerate(noise)))
        place = triangulate(moved, MAX_ERROR_PX)
        errors.append(place.xyz - TARGET)
    expected = NOISE_PX * np.sqrt(np.diag(place.covariance))
    np.testing.assert_allclose(np.std(errors, axis=0), expected, rtol=0.15)


def test_a_wrong_mark_is_named_and_moves_nothing(sightings):
    place = triangulate(marked(sightings, (2, 12, -9)), MAX_ERROR_PX)
    np.testing.assert_allclose(place.xyz, TARGET, atol=1e-6)
    assert np.flatnonzero(~place.agree).tolist() == [2]
    np.testing.assert_allclose(place.residuals_px[2], (12, -9), atol=1e-3)


def test_two_of_three_marks_that_agree_win(sightings):
    place = triangulate(marked(sightings[:3], (1, 5, 40)), MAX_ERROR_PX)
    assert np.flatnonzero(~place.agree).tolist() == [1]


def test_marks_that_contradict_each_other_give_no_place(sightings):
    assert triangulate(marked(sightings[:2], (1, 0, 40)), MAX_ERROR_PX) is None
    assert triangulate(sightings[:1], MAX_ERROR_PX) is None
    assert triangulate([], MAX_ERROR_PX) is None


def test_parallel_rays_give_no_place(sightings):
    assert triangulate([sightings[0], sightings[0]], MAX_ERROR_PX) is None
