"""A model held to measured positions: straightened by right ones, not bent by wrong ones."""

from __future__ import annotations

import copy

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import SceneFeed, centre_of, position_errors_m

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions, median_error
from sfm_front.mapping.final_adjustment import final_adjustment
from sfm_front.mapping.mapper_options import InitialPairConstraints, MapperOptions
from sfm_front.mapping.model import Model
from sfm_front.mapping.position_priors import PositionPriors, PriorOptions, held_to_positions
from sfm_front.types import Float64Array

NUM_PHOTOS = 20
DEMANDS = InitialPairConstraints(min_angle_deg=5, min_inliers=50)
ADJUSTMENT = RobustAdjustmentOptions(num_threads=1)
EXACT_M = 0.05


@pytest.fixture(scope="module")
def flight() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 250, seed=3, layout="strip")


@pytest.fixture(scope="module")
def first(flight) -> Model:
    """A model of all photos, in a frame of its own, on a camera that nobody knows."""
    feed = SceneFeed(flight)
    feed.camera.params = [1600.0, 800.0, 600.0, 0.0]
    ids = feed.add_all(range(NUM_PHOTOS))
    model = Model(feed.scene, MapperOptions(num_threads=1))
    assert model.initialize(2, 1, DEMANDS)
    model.grow(ids)
    assert model.num_registered == NUM_PHOTOS
    return model


@pytest.fixture
def grown(first) -> Model:
    """The same for each test."""
    return first.succeeded_by(copy.deepcopy(first.reconstruction))


@pytest.fixture(scope="module")
def adjusted(flight, first) -> pycolmap.Reconstruction:
    """As the photos alone have it, moved to the world of the flight."""
    model = final_adjustment(copy.deepcopy(first.reconstruction), ADJUSTMENT).reconstruction
    model.transform(world_from(model, flight))
    return model


def true_centres(flight: SyntheticScene) -> dict[int, Float64Array]:
    """By image id, as ``SceneFeed`` gives them."""
    return {index + 1: centre_of(pose) for index, pose in enumerate(flight.cams_from_world)}


def world_from(model: pycolmap.Reconstruction, flight: SyntheticScene) -> pycolmap.Sim3d:
    truth, ids = true_centres(flight), model.reg_image_ids()
    found = pycolmap.estimate_sim3d(
        np.array([model.image(i).projection_center() for i in ids]),
        np.array([truth[i] for i in ids]),
    )
    assert found is not None
    return found


def priors(flight: SyntheticScene, stretch: float = 1.0, sigma_m: float = EXACT_M):
    """Positions that are true, but for a scale of the north."""
    truth = true_centres(flight)
    return PositionPriors(
        {i: centre * (1, stretch, 1) for i, centre in truth.items()},
        {i: np.full(3, sigma_m) for i in truth},
    )


def test_right_positions_straighten_a_model(flight, adjusted):
    before = position_errors_m(adjusted, flight)
    held = held_to_positions(adjusted, priors(flight), ADJUSTMENT, PriorOptions())
    assert held is not None
    # As it stands: no fit to the truth.
    truth = true_centres(flight)
    errors = [
        np.linalg.norm(held.image(i).projection_center() - truth[i]) for i in held.reg_image_ids()
    ]
    assert np.max(errors) < 0.5 * before.max()
    assert np.max(errors) < 5 * EXACT_M
    (camera,) = held.cameras.values()
    assert camera.mean_focal_length() == pytest.approx(1300, rel=0.003)
    assert median_error(held) <= 1.03 * median_error(adjusted)


def test_positions_that_contradict_the_photos_are_refused(flight, adjusted):
    given, wrong = copy.deepcopy(adjusted), priors(flight, 1.02, sigma_m=0.01)
    assert held_to_positions(given, wrong, ADJUSTMENT, PriorOptions()) is None
    # It is as it was.
    for image_id in adjusted.reg_image_ids():
        pose, before = (model.image(image_id).cam_from_world() for model in (given, adjusted))
        assert (pose.matrix() == before.matrix()).all()
    generous = PriorOptions(max_error_rise=0.5)
    assert held_to_positions(given, wrong, ADJUSTMENT, generous) is not None


@pytest.mark.parametrize("sigma_m", [0.01, 0.5])
def test_positions_far_from_what_photos_allow_do_not_bend_a_model(flight, adjusted, sigma_m):
    """They lose their weight."""
    wrong = priors(flight, 1.2, sigma_m)
    held = held_to_positions(adjusted, wrong, ADJUSTMENT, PriorOptions())
    assert held is not None
    assert position_errors_m(held, flight).max() < 0.5


@pytest.mark.parametrize(("stretch", "expected"), [(1.0, True), (1.02, False)])
def test_a_model_knows_whether_it_is_held(flight, grown, stretch, expected):
    assert grown.is_held_to_positions is None
    grown.georeference(
        world_from(grown.reconstruction, flight), priors(flight, stretch, sigma_m=0.01)
    )
    assert grown.is_georeferenced
    assert grown.state.is_georeferenced
    grown.finish()
    assert grown.is_held_to_positions is expected
    # Neither turned nor scaled by its last adjustment.
    assert position_of(grown, 1) == pytest.approx(true_centres(flight)[1], abs=3.0)


def position_of(model: Model, image_id: int) -> Float64Array:
    return np.asarray(model.reconstruction.image(image_id).projection_center())


def test_a_model_keeps_its_frame_while_it_is_refined_and_restored(flight, grown):
    grown.georeference(world_from(grown.reconstruction, flight), priors(flight))
    before = position_of(grown, 1)
    grown.refine()
    assert position_of(grown, 1) == pytest.approx(before, abs=1.0)
    again = grown.succeeded_by(copy.deepcopy(grown.reconstruction))
    assert again.is_georeferenced
    again.refine()
    assert position_of(again, 1) == pytest.approx(before, abs=1.0)


def test_two_positions_are_too_few(flight, adjusted):
    few = priors(flight)
    few = PositionPriors(dict(list(few.positions.items())[:2]), few.sigmas)
    assert not few.are_enough
    assert held_to_positions(adjusted, few, ADJUSTMENT, PriorOptions()) is None


@pytest.mark.parametrize("wrong", [{"max_error_rise": -0.1}, {"loss_scale": 0}])
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        PriorOptions(**wrong)
