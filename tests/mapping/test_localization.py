"""A photo's pose by its pairs with photos of a model, on a flight with known poses."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import SceneFeed, centre_of, true_pair, view_of

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.mapping.localization import LocalizationOptions, locate, registered_photo
from sfm_front.types import PairGeometry

IMAGES = {1: 0, 2: 1, 3: 2, 4: 3}
NEW, NEW_ID = 4, 5
POSITION_TOLERANCE = 0.01  # of the distance flown from the first photo
ANGLE_TOLERANCE_DEG = 0.3


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(12, 600, seed=5, layout="orbit")


@pytest.fixture(scope="module")
def model(orbit) -> pycolmap.Reconstruction:
    """The true model of four photos: points that two or more of them see."""
    feed = SceneFeed(orbit)
    feed.add_all(IMAGES.values())
    _, reconstruction = feed.scene.new_mapper()
    for image_id, index in IMAGES.items():
        frame = reconstruction.image(image_id).frame
        frame.rig_from_world = orbit.cams_from_world[index]
        reconstruction.register_frame(frame.frame_id)
    ids = {i: orbit.photo(index).point_ids for i, index in IMAGES.items()}
    for point in range(len(orbit.points)):
        seen = [(i, np.flatnonzero(of_photo == point)) for i, of_photo in ids.items()]
        elements = [pycolmap.TrackElement(i, int(where[0])) for i, where in seen if len(where)]
        if len(elements) > 1:
            reconstruction.add_point3D(orbit.points[point], pycolmap.Track(elements))
    return reconstruction


@pytest.fixture(scope="module")
def pairs(orbit) -> list[PairGeometry]:
    return [true_pair(orbit, NEW, index, (NEW_ID, i)) for i, index in list(IMAGES.items())[1:]]


def keypoints(orbit: SyntheticScene) -> np.ndarray:
    return view_of(orbit, NEW, NEW_ID).features.keypoints


def test_the_pose_is_the_true_one(orbit, model, pairs):
    found = locate(model, orbit.camera.camera_id, keypoints(orbit), pairs, LocalizationOptions())
    truth = orbit.cams_from_world[NEW]
    assert found is not None
    flown = np.linalg.norm(centre_of(truth) - centre_of(orbit.cams_from_world[0]))
    assert np.linalg.norm(found.center - centre_of(truth)) < POSITION_TOLERANCE * flown
    turned = found.cam_from_world.rotation * truth.rotation.inverse()
    assert np.rad2deg(turned.angle()) < ANGLE_TOLERANCE_DEG
    assert found.camera.params.tolist() == model.camera(orbit.camera.camera_id).params.tolist()


def test_the_same_is_found_again(orbit, model, pairs):
    first, second = (
        locate(model, orbit.camera.camera_id, keypoints(orbit), pairs, LocalizationOptions())
        for _ in range(2)
    )
    assert first.cam_from_world == second.cam_from_world


def test_a_camera_that_the_model_does_not_have_gives_no_pose(orbit, model, pairs):
    assert locate(model, 99, keypoints(orbit), pairs, LocalizationOptions()) is None


def test_pairs_that_lead_nowhere_give_no_pose(orbit, model):
    camera_id, options = orbit.camera.camera_id, LocalizationOptions()
    assert locate(model, camera_id, keypoints(orbit), [], options) is None
    astray = true_pair(orbit, NEW, 6, (NEW_ID, 77))
    assert locate(model, camera_id, keypoints(orbit), [astray], options) is None


def test_points_that_fit_no_pose_give_none(orbit, model, pairs):
    places = keypoints(orbit).copy()
    np.random.default_rng(0).shuffle(places)
    found = locate(model, orbit.camera.camera_id, places, pairs, LocalizationOptions())
    assert found is None


def test_too_few_points_give_no_pose(orbit, model, pairs):
    many = LocalizationOptions(min_inliers=10**6)
    assert locate(model, orbit.camera.camera_id, keypoints(orbit), pairs, many) is None


def test_registered_photos_are_known_and_others_are_not(orbit, model):
    posed = registered_photo(model, 2)
    np.testing.assert_allclose(posed.center, centre_of(orbit.cams_from_world[1]))
    assert registered_photo(model, 77) is None
    empty = SceneFeed(orbit)
    empty.add(0)
    assert registered_photo(empty.scene.new_mapper()[1], 1) is None


@pytest.mark.parametrize(
    "wrong",
    [{"max_error_px": 0}, {"min_inliers": 3}, {"min_share": 1.5}, {"sample": 0}],
)
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        LocalizationOptions(**wrong)
