"""Several models at once, over scenes with known truth and true matches."""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from helpers.photo_stream import SceneFeed, position_errors_m, registered_names, true_pair
from helpers.view_graphs import graph_of, line

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import (
    DropReason,
    Emit,
    ModelDropped,
    ModelEvent,
    ModelRefined,
    ModelStarted,
    StartKind,
)
from sfm_front.mapping.atlas import Atlas, AtlasOptions
from sfm_front.mapping.finishing import finish
from sfm_front.mapping.initialization import InitializationOptions
from sfm_front.mapping.mapper_options import InitialPairConstraints, MapperOptions
from sfm_front.mapping.model import Model
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import PairGeometry

NUM_PHOTOS = 16
# The photos stand on a circle of 40 m; 0.5 px of noise are 15 mm on the surface they see.
POSITION_TOLERANCE_M = 0.15
# A ring is flown at 100 m; 0.5 px are 4 cm on the ground, and add up over 550 m.
RING_TOLERANCE_M = 2.0
OPTIONS = AtlasOptions(mapper=MapperOptions(num_threads=1))


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 500, seed=4, layout="orbit")


def run(feed: SceneFeed, indices: Iterable[int], emit: Emit | None = None) -> Atlas:
    """Photos added one at a time; the atlas before ``finish``."""
    atlas = Atlas(feed.scene, OPTIONS, emit)
    for index in indices:
        atlas.add(feed.add(index))
    return atlas


def assert_whole(atlas: Atlas, scene: SyntheticScene) -> None:
    """One model, of all photos, and true."""
    assert [model.num_registered for model in atlas.models] == [len(scene)]
    assert atlas.waiting == []
    errors = position_errors_m(atlas.models[0].reconstruction, scene)
    assert errors.max() < POSITION_TOLERANCE_M


def test_photos_in_order_are_placed_as_they_arrive(orbit):
    feed = SceneFeed(orbit)
    atlas = Atlas(feed.scene, OPTIONS)
    assert atlas.registered == set()
    placed = [atlas.add(feed.add(index)) for index in range(NUM_PHOTOS)]
    ids = [image_id for step in placed for image_id in step]
    assert sorted(ids) == list(range(1, NUM_PHOTOS + 1))
    # Once there is a model, each photo is placed when it comes.
    assert placed[4:] == [[image_id] for image_id in range(5, NUM_PHOTOS + 1)]
    finish(atlas)
    assert_whole(atlas, orbit)


@pytest.mark.parametrize("seed", range(3))
def test_photos_in_any_order_are_all_placed(orbit, seed):
    order = list(range(NUM_PHOTOS))
    random.Random(seed).shuffle(order)
    atlas = run(SceneFeed(orbit), order)
    finish(atlas)
    assert_whole(atlas, orbit)


def test_a_stream_that_begins_badly_ends_whole():
    """So few points that the first photos carry no model, or one that does not grow."""
    sparse = make_scene(NUM_PHOTOS, 250, seed=4, layout="orbit")
    atlas = run(SceneFeed(sparse), range(NUM_PHOTOS))
    finish(atlas)
    assert_whole(atlas, sparse)


def test_photos_with_few_points_are_a_model_when_no_more_will_come():
    poor = make_scene(NUM_PHOTOS, 100, seed=1, layout="orbit", background_ratio=0.0)
    atlas = run(SceneFeed(poor), range(5))
    assert atlas.models == []
    finish(atlas)
    assert [model.num_registered for model in atlas.models] == [5]


def test_a_camera_that_photos_do_not_tell_is_held(orbit, monkeypatch):
    """Stands in for a flight over flat ground, where focal length and distortion drift away."""
    monkeypatch.setattr(
        Model, "is_miscalibrated", property(lambda model: model._options.refine_intrinsics)
    )
    other = make_scene(NUM_PHOTOS, 500, seed=5, layout="orbit")
    feed, events = SceneFeed(orbit), []
    atlas = run(feed, range(NUM_PHOTOS), events.append)
    elsewhere = SceneFeed(other, feed.scene, prefix="b/")
    for index in range(8):
        atlas.add(elsewhere.add(index))
    finish(atlas)
    assert [model.registered for model in atlas.models] == [
        set(feed.index_of),
        set(elsewhere.index_of),
    ]
    assert position_errors_m(atlas.models[0].reconstruction, orbit).max() < POSITION_TOLERANCE_M
    for model in atlas.models:
        camera = model.reconstruction.camera(1)
        np.testing.assert_array_equal(camera.params, orbit.camera.params)
    started = [event for event in events if isinstance(event, ModelStarted)]
    held = {e.model_id for e in started if e.kind is StartKind.FIXED_INTRINSICS}
    assert held >= {model.model_id for model in atlas.models}
    assert DropReason.REPLACED in [e.reason for e in events if isinstance(e, ModelDropped)]


def test_two_places_are_two_models(orbit):
    other = make_scene(NUM_PHOTOS, 500, seed=5, layout="orbit")
    feed = SceneFeed(orbit)
    elsewhere = SceneFeed(other, feed.scene, prefix="b/")
    atlas = Atlas(feed.scene, OPTIONS)
    for index in range(NUM_PHOTOS):  # by turns, as long as the smaller place has photos
        atlas.add(feed.add(index))
        if index < 8:
            atlas.add(elsewhere.add(index))
    finish(atlas)
    assert [model.registered for model in atlas.models] == [
        set(feed.index_of),
        set(elsewhere.index_of),
    ]
    for model, scene, prefix in zip(atlas.models, (orbit, other), ("", "b/"), strict=True):
        errors = position_errors_m(model.reconstruction, scene, prefix=prefix)
        assert errors.max() < POSITION_TOLERANCE_M


def test_models_that_come_to_connect_are_joined(orbit):
    feed = SceneFeed(orbit)
    events: list[ModelEvent] = []
    atlas = Atlas(feed.scene, OPTIONS, events.append)
    for index in [*range(5), *range(8, 13)]:
        atlas.add(feed.add(index))
    assert [model.num_registered for model in atlas.models] == [5, 5]
    for index in [5, 6, 7, 13, 14, 15]:
        atlas.add(feed.add(index))
    finish(atlas)
    assert_whole(atlas, orbit)
    (dropped,) = [event for event in events if isinstance(event, ModelDropped)]
    assert dropped.reason is DropReason.COVERED
    assert str(dropped).startswith("model ")
    assert dropped.model_id not in {model.model_id for model in atlas.models}


def test_a_round_trip_ends_where_it_began():
    """Its last photos see what its first ones saw: the model is as true as the whole survey."""
    ring = make_scene(40, 400, seed=5, layout="ring")
    atlas = run(SceneFeed(ring), range(len(ring)))
    finish(atlas)
    assert [model.num_registered for model in atlas.models] == [len(ring)]
    reconstruction = atlas.models[0].reconstruction
    assert position_errors_m(reconstruction, ring).max() < RING_TOLERANCE_M
    first = reconstruction.image(1)
    shared = {
        element.image_id
        for index in first.get_observation_point2D_idxs()
        for element in reconstruction.point3D(first.point2D(index).point3D_id).track.elements
    }
    assert shared & {len(ring) - 1, len(ring)}


class TruckFeed(SceneFeed):
    """The first three photos, from all around the place, show the same truck, which drove along:
    pairs that are sound among themselves and say nothing true about where the photos stand."""

    PLACES = (0, 5, 10)

    def __init__(self, place: SyntheticScene, truck: SyntheticScene) -> None:
        super().__init__(place)
        self._truck = truck
        for number, index in enumerate(self.PLACES):
            # The truck's keypoints stand behind those of the place.
            of_place, of_truck = place.photo(index).features, truck.photo(number).features
            keypoints = np.concatenate([of_place.keypoints, of_truck.keypoints])
            pairs = [self._truck_pair(number, other) for other in range(number)]
            self.scene.add(number + 1, place.name(index), self.camera, keypoints, pairs)
            self.index_of[number + 1] = index

    def _truck_pair(self, number: int, other: int) -> PairGeometry:
        pair = true_pair(self._truck, number, other, (number + 1, other + 1))
        before = [len(self.synthetic.photo(self.PLACES[n]).features) for n in (number, other)]
        matches = pair.matches + np.array(before, np.uint32)
        pair.two_view_geometry.inlier_matches = matches
        return replace(pair, matches=matches)


def test_a_bad_start_is_recovered_from(orbit):
    feed = TruckFeed(orbit, make_scene(NUM_PHOTOS, 400, seed=6, layout="orbit"))
    atlas = Atlas(feed.scene, OPTIONS)
    atlas.add(3)
    assert atlas.registered == {1, 2, 3}
    for index in sorted(set(range(NUM_PHOTOS)) - set(feed.PLACES)):
        atlas.add(feed.add(index))
    finish(atlas)
    assert_whole(atlas, orbit)


def test_a_wrong_focal_length_at_the_start_does_not_last(orbit):
    feed = SceneFeed(orbit)
    feed.camera.params = [2.0 * 1300.0, 800.0, 600.0, 0.0]
    atlas = run(feed, range(NUM_PHOTOS))
    finish(atlas)
    assert_whole(atlas, orbit)
    (camera,) = atlas.models[0].reconstruction.cameras.values()
    assert camera.mean_focal_length() == pytest.approx(1300, rel=0.02)


def test_what_is_linked_to_nothing_says_so(orbit):
    feed = SceneFeed(orbit)
    atlas = run(feed, range(6))
    stranger = SceneFeed(make_scene(4, 100, seed=7), feed.scene, prefix="b/")
    image_id = stranger.add(0)
    assert atlas.add(image_id) == []
    finish(atlas)
    assert atlas.waiting == [image_id]
    assert str(atlas.why_not_registered(image_id)) == "no verified matches with any photo"


def test_two_photos_that_know_only_each_other_say_so(orbit):
    feed = SceneFeed(orbit)
    atlas = run(feed, range(6))
    pair = SceneFeed(make_scene(12, 400, seed=7, layout="orbit"), feed.scene, prefix="b/")
    ids = []
    for index in (0, 1):
        ids.append(pair.add(index))
        atlas.add(ids[-1])
    finish(atlas)
    assert atlas.waiting == ids
    assert {str(atlas.why_not_registered(image_id)) for image_id in ids} == {
        "verified matches only with photos that are not registered"
    }


def test_events_tell_how_models_began_and_were_refined(orbit):
    events: list[ModelEvent] = []
    atlas = run(SceneFeed(orbit), range(6), events.append)
    started, *refined = events
    assert isinstance(started, ModelStarted)
    assert started.kind is StartKind.STREAM
    assert set(started.image_ids) <= atlas.registered
    assert refined
    assert all(isinstance(event, ModelRefined) for event in refined)
    assert {event.model_id for event in refined} == {started.model_id}
    assert refined[-1].num_registered <= atlas.models[0].num_registered
    assert all(event.seconds > 0 for event in refined)


def test_an_atlas_without_photos_or_matches_ends_without_models():
    atlas = Atlas(ViewGraph(), OPTIONS)
    assert atlas.waiting == []
    stranger = SceneFeed(make_scene(1, 50, seed=8))
    alone = run(stranger, [0])
    finish(alone)
    assert alone.models == []
    assert registered_names([]) == set()
    assert str(alone.why_not_registered(1)) == "no verified matches with any photo"


def test_a_camera_that_did_not_move_is_not_searched_for_a_start(orbit, monkeypatch):
    """COLMAP would estimate every pair anew at every level."""

    def search(*_: object) -> None:
        raise AssertionError("searched")

    monkeypatch.setattr(Model, "find_initial_pair", search)
    monkeypatch.setattr(ViewGraph, "angle_deg", lambda *_: 0.2)
    atlas = run(SceneFeed(orbit), range(8))
    finish(atlas)
    assert atlas.models == []
    assert atlas.waiting == list(range(1, 9))


def test_pairs_with_too_few_matches_take_no_trials(monkeypatch):
    """Along a street there are many such; one that could begin a model must get its turn."""
    asked: list[int] = []

    def initialize(_: Model, *args: object) -> bool:
        constraints = args[2]
        assert isinstance(constraints, InitialPairConstraints)
        asked.append(constraints.min_inliers)
        return False

    monkeypatch.setattr(Model, "initialize", initialize)
    atlas = Atlas(graph_of(10, line(1, 10)), OPTIONS)  # 50 matches each
    atlas.add(10)
    assert asked == [50] * InitializationOptions().max_trials


def test_the_cost_of_global_refinement_stays_amortised(orbit, monkeypatch):
    """Sizes at which the growing model was refined as a whole, against the geometric series."""
    from sfm_front.mapping import model as mapper

    sizes: list[int] = []
    refine = mapper.Model._refine

    def counted(model: mapper.Model, *arguments: object) -> None:
        sizes.append(model.num_registered)
        refine(model, *arguments)

    monkeypatch.setattr(mapper.Model, "_refine", counted)
    atlas = run(SceneFeed(orbit), range(NUM_PHOTOS))
    growth = OPTIONS.mapper.schedule.growth
    assert atlas.models[0].num_registered == NUM_PHOTOS
    # Photos and points each have their series.
    assert sum(sizes) <= 2 * NUM_PHOTOS * growth / (growth - 1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"min_second_model": 1},
        {"min_model_size": 1},
        {"max_missed_share": 1.1},
        {"min_share": -0.1},
        {"fresh_starts": -1},
        {"max_failures": -1},
    ],
)
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        AtlasOptions(**wrong)


@pytest.mark.parametrize(
    "wrong", [{"angle_tolerance": 1.5}, {"max_trials": 0}, {"max_last_trials": 0}]
)
def test_initialization_out_of_range_is_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        InitializationOptions(**wrong)
