"""A camera that EXIF tells is held until its photos tell it better."""

from __future__ import annotations

import pycolmap
import pytest
from helpers.photo_stream import SceneFeed

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.mapping.mapper_options import InitialPairConstraints, MapperOptions
from sfm_front.mapping.model import Model

NUM_PHOTOS = 14
DEMANDS = InitialPairConstraints(min_angle_deg=10, min_inliers=50)
OPTIONS = MapperOptions(num_threads=1)
TRUE_PX = 1300.0
# EXIF is seldom wrong by more.
EXIF_PX = 1.03 * TRUE_PX


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 500, seed=3, layout="orbit", noise_px=0.2)


def feed_of(scene: SyntheticScene, *, has_exif: bool) -> SceneFeed:
    feed = SceneFeed(scene)
    feed.camera.params = [EXIF_PX, 800.0, 600.0, 0.0]
    feed.camera.has_prior_focal_length = has_exif
    return feed


def started(feed: SceneFeed) -> Model:
    feed.add_all(range(NUM_PHOTOS))
    model = Model(feed.scene, OPTIONS)
    assert model.initialize(2, 1, DEMANDS)
    return model


def camera_of(model: Model) -> pycolmap.Camera:
    (camera,) = model.reconstruction.cameras.values()
    return camera


def test_two_photos_do_not_move_what_exif_says(orbit):
    model = started(feed_of(orbit, has_exif=True))
    model.refine()
    assert camera_of(model).params.tolist() == [EXIF_PX, 800.0, 600.0, 0.0]
    assert not model.state.is_camera_determined


def test_they_move_what_nobody_says(orbit):
    model = started(feed_of(orbit, has_exif=False))
    assert camera_of(model).mean_focal_length() != EXIF_PX


def test_photos_that_determine_it_set_it_free(orbit):
    model = started(feed_of(orbit, has_exif=True))
    model.grow(range(1, NUM_PHOTOS + 1))
    model.refine()
    assert model.state.is_camera_determined
    model.refine()
    assert camera_of(model).mean_focal_length() == pytest.approx(TRUE_PX, rel=0.005)


def test_a_model_that_goes_on_still_holds_it(orbit):
    feed = feed_of(orbit, has_exif=True)
    model = started(feed)
    again = Model.restored(feed.scene, OPTIONS, model.reconstruction, model.state)
    again.refine()
    assert camera_of(again).mean_focal_length() == EXIF_PX


def test_local_adjustments_hold_it_too(orbit):
    model = started(feed_of(orbit, has_exif=True))
    assert model.grow(range(1, NUM_PHOTOS + 1), at_most=1)
    assert model.num_registered == 3
    assert not model.state.is_camera_determined
    assert camera_of(model).mean_focal_length() == EXIF_PX
