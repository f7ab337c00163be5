"""The ladder of lenses: the same camera on a higher rung, and distortions that fold back."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest

from sfm_front.geometry.lenses import (
    LADDER,
    as_opencv,
    grown,
    is_one_to_one,
    simplified,
    take_intrinsics,
)

PARAMS = {
    "SIMPLE_PINHOLE": [500, 330, 230],
    "PINHOLE": [500, 510, 330, 230],
    "SIMPLE_RADIAL": [500, 330, 230, -0.1],
    "RADIAL": [500, 330, 230, -0.1, 0.05],
    "OPENCV": [500, 510, 330, 230, -0.1, 0.05, 0.001, -0.002],
}


def camera(model: str, params=None) -> pycolmap.Camera:
    return pycolmap.Camera(
        camera_id=7, model=model, width=640, height=480, params=params or PARAMS[model]
    )


def rays() -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(-0.6, 0.6, (50, 2)), np.ones(50)])


def images_of(a: pycolmap.Camera):
    return np.asarray(a.img_from_cam(rays()))


@pytest.mark.parametrize("model", PARAMS)
def test_as_opencv_it_is_the_same_camera(model):
    same = as_opencv(camera(model))
    assert (same.model_name, same.camera_id, same.width) == ("OPENCV", 7, 640)
    np.testing.assert_allclose(images_of(same), images_of(camera(model)), atol=1e-9)


@pytest.mark.parametrize(
    ("low", "high"), [(low, high) for i, low in enumerate(LADDER) for high in LADDER[i:]]
)
def test_a_grown_camera_is_the_same_until_it_is_refined(low, high):
    higher = grown(camera(low), high)
    assert higher.model_name == high
    np.testing.assert_allclose(images_of(higher), images_of(camera(low)), atol=1e-9)


@pytest.mark.parametrize("model", LADDER[:2])
def test_a_simplified_camera_is_the_nearest_one(model):
    same = simplified(grown(camera(model), "OPENCV"), model)
    np.testing.assert_allclose(same.params, PARAMS[model], atol=1e-6)
    rich = camera("OPENCV", [500, 500, 330, 230, -0.2, 0.1, 0, 0])
    simple = simplified(rich, model)
    cut = camera("SIMPLE_RADIAL", [500, 330, 230, -0.2])
    off, off_cut = (np.linalg.norm(images_of(c) - images_of(rich), axis=1) for c in (simple, cut))
    assert np.sqrt((off**2).mean()) < 0.3 * np.sqrt((off_cut**2).mean())


def test_a_fisheye_is_none_of_opencvs():
    assert as_opencv(camera("OPENCV_FISHEYE", [500, 500, 320, 240, 0, 0, 0, 0])) is None


def test_intrinsics_are_taken_over_with_the_model():
    target = camera("SIMPLE_RADIAL")
    target.has_prior_focal_length = True
    take_intrinsics(target, camera("OPENCV"))
    assert target.params.tolist() == PARAMS["OPENCV"]
    assert (target.model_name, target.camera_id) == ("OPENCV", 7)
    assert target.has_prior_focal_length


@pytest.mark.parametrize(
    ("k1", "k2", "expected"),
    [
        (0.0, 0.0, True),
        (-0.2, 0.05, True),
        (0.3, 0.0, True),
        (-0.6, 0.0, False),  # turns back at a radius of 0.75: corners are at 0.8
        (0.1, -0.7, False),
    ],
)
def test_a_distortion_that_turns_back_before_the_corners(k1, k2, expected):
    assert is_one_to_one(camera("RADIAL", [500, 320, 240, k1, k2])) is expected
