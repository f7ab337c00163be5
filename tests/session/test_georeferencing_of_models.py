"""Models that come, go and change while positions say where they stand."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from helpers.photo_stream import SceneFeed
from helpers.positioned_stream import FRAME, measured, positions_at, true_centres

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import Georeferenced, ModelEvent
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.mapping.mapper_options import InitialPairConstraints, MapperOptions
from sfm_front.mapping.model import Model
from sfm_front.photos.positions import PositionOptions
from sfm_front.session.georeferencing import Georeferencing
from sfm_front.session.photo_positions import PhotoPositions
from sfm_front.types import Exif, Float64Array

NUM_PHOTOS = 14
DEMANDS = InitialPairConstraints(min_angle_deg=5, min_inliers=50)
TOLERANCE_M = 3.0


@pytest.fixture(scope="module")
def flight() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 250, seed=3, layout="strip")


@pytest.fixture(scope="module")
def grown(flight) -> list[Model]:
    """Two models of all photos, each from a pair of its own."""
    feed = SceneFeed(flight)
    ids = feed.add_all(range(NUM_PHOTOS))
    models = []
    for model_id, pair in enumerate([(2, 1), (8, 7)], start=1):
        model = Model(feed.scene, MapperOptions(num_threads=1))
        model.model_id = model_id
        assert model.initialize(*pair, DEMANDS)
        model.grow(ids)
        assert model.num_registered == NUM_PHOTOS
        models.append(model)
    return models


@pytest.fixture
def models(grown) -> list[Model]:
    """The same for each test, in frames of their own."""
    return [model.succeeded_by(copy.deepcopy(model.reconstruction)) for model in grown]


@pytest.fixture
def events() -> list[ModelEvent]:
    return []


@pytest.fixture
def georeferencing(flight, events) -> Georeferencing:
    positions = PhotoPositions(PositionOptions())
    for index, position in enumerate(positions_at(measured(flight))):
        positions.take(index + 1, flight.name(index), Exif(position=position))
    return Georeferencing(positions, events.append, seed=0, is_on=True)


def errors_m(model: Model, georeferencing: Georeferencing, flight: SyntheticScene) -> Float64Array:
    """(N, 3) of a model as it stands."""
    frame, image_ids = georeferencing.georeference.frame, model.reconstruction.reg_image_ids()
    assert frame is not None
    centres = [model.reconstruction.image(i).projection_center() for i in image_ids]
    truth = true_centres(flight)[[i - 1 for i in image_ids]]
    return np.abs(FRAME.to_enu(frame.to_wgs84(np.array(centres))) - truth)


def test_a_model_in_the_place_of_a_metric_one_is_metric_at_once(
    flight, models, georeferencing, events
):
    first, second = models
    georeferencing.follow([first])
    frame = georeferencing.georeference.frame
    georeferencing.follow([second])
    assert second.is_georeferenced
    assert georeferencing.georeference.frame == frame
    assert errors_m(second, georeferencing, flight).max() < TOLERANCE_M
    said = [(e.model_id, e.state) for e in events if isinstance(e, Georeferenced)]
    assert said == [(1, "metric"), (2, "metric")]


def test_a_model_is_not_turned_while_it_is_refined_but_soon_after(
    flight, models, georeferencing, monkeypatch
):
    with monkeypatch.context() as refined:
        refined.setattr(Model, "is_under_way", property(lambda _: True))
        georeferencing.follow(models[:1])
        georeferencing.settle(models[:1])
    assert not models[0].is_georeferenced
    # No further position has come.
    georeferencing.follow(models[:1])
    assert models[0].is_georeferenced
    assert errors_m(models[0], georeferencing, flight).max() < TOLERANCE_M


def test_what_is_said_is_of_the_model_as_it_is(models, georeferencing):
    """Not as it was looked at last: photos may have left it, or another one is the largest."""
    first, second = models
    georeferencing.settle([first])
    smaller = first.only(range(1, NUM_PHOTOS - 2))
    sidecar = georeferencing.sidecar([smaller])
    assert sidecar.state is GeoreferenceState.METRIC
    assert sidecar.residuals.num_used == NUM_PHOTOS - 3
    assert georeferencing.sidecar([second, first]).models_in_enu == (1,)
    assert georeferencing.sidecar([second, first]).enu_from_built is None
    assert georeferencing.sidecar([]).reasons == ("there is no model",)


def test_where_a_model_was_built_is_remembered(models, georeferencing):
    (model, _), built = models, copy.deepcopy(models[0].reconstruction)
    for _ in range(2):
        georeferencing.settle([model])
    moved = georeferencing.sidecar([model]).enu_from_built
    for image_id in built.reg_image_ids():
        np.testing.assert_allclose(
            moved * built.image(image_id).projection_center(),
            model.reconstruction.image(image_id).projection_center(),
            atol=1e-6,
        )


def test_what_is_known_goes_with_a_session(models, georeferencing, flight):
    first, second = models
    georeferencing.settle([first])
    again = Georeferencing(PhotoPositions(PositionOptions()), lambda _: None, seed=0, is_on=True)
    again.restore(georeferencing.as_json())
    assert again.as_json() == georeferencing.as_json()
    again = Georeferencing(georeferencing._positions, lambda _: None, seed=0, is_on=True)
    again.restore(georeferencing.as_json())
    again.settle([second])
    assert again.georeference.frame == georeferencing.georeference.frame
    assert errors_m(second, again, flight).max() < TOLERANCE_M


def test_off_is_off(models, flight):
    positions = PhotoPositions(PositionOptions())
    for index, position in enumerate(positions_at(measured(flight))):
        positions.take(index + 1, flight.name(index), Exif(position=position))
    off = Georeferencing(positions, lambda _: None, seed=0, is_on=False)
    off.settle(models)
    assert not any(model.is_georeferenced for model in models)
    assert off.sidecar(models) is None
    assert off.outcome(models) is None
