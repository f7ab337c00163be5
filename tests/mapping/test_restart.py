"""Another start for the largest model, a few photos at a time."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers.photo_stream import SceneFeed, position_errors_m, true_pair

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import DropReason, ModelDropped, ModelEvent, ModelStarted, StartKind
from sfm_front.mapping.atlas import Atlas, AtlasOptions
from sfm_front.mapping.initialization import InitializationOptions
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.mapping.restart import Restart

NUM_PHOTOS = 16
POSITION_TOLERANCE_M = 0.15
OPTIONS = AtlasOptions(mapper=MapperOptions(num_threads=1))


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 500, seed=4, layout="orbit")


def not_begun(orbit: SyntheticScene, events: list[ModelEvent], *, last: int) -> Atlas:
    """No model could be started while these photos came."""
    unwilling = replace(OPTIONS, initialization=InitializationOptions(constraint_levels=()))
    atlas = Atlas(SceneFeed(orbit).scene, unwilling, events.append)
    feed = SceneFeed(orbit, atlas.view_graph)
    for index in range(last):
        atlas.add(feed.add(index))
    assert atlas.models == []
    atlas.initializer = Atlas(atlas.view_graph, OPTIONS, events.append).initializer
    return atlas


def test_it_goes_on_a_few_photos_at_a_time_and_ends_whole(orbit):
    events: list[ModelEvent] = []
    atlas = not_begun(orbit, events, last=NUM_PHOTOS)
    restart = Restart(atlas)
    assert restart.go_on(at_most=2)
    assert atlas.models == []
    steps = 1
    while restart.go_on(at_most=2):
        steps += 1
    # Two photos begin it, the others come two by two.
    assert steps >= (NUM_PHOTOS - 2) // 2
    assert [model.num_registered for model in atlas.models] == [NUM_PHOTOS]
    errors = position_errors_m(atlas.models[0].reconstruction, orbit)
    assert errors.max() < POSITION_TOLERANCE_M
    (started,) = (event for event in events if isinstance(event, ModelStarted))
    assert started.kind is StartKind.RESTART
    assert not restart.go_on()


def test_a_photo_that_comes_meanwhile_is_in_the_next_one(orbit):
    events: list[ModelEvent] = []
    atlas = not_begun(orbit, events, last=NUM_PHOTOS - 1)
    restart = Restart(atlas)
    assert restart.go_on(at_most=2)
    feed = SceneFeed(orbit, atlas.view_graph)
    feed.index_of = {i + 1: i for i in range(NUM_PHOTOS - 1)}
    feed.add(NUM_PHOTOS - 1)
    while restart.go_on(at_most=2):
        pass
    assert [model.num_registered for model in atlas.models] == [NUM_PHOTOS]


def test_no_better_start_is_dropped_and_not_tried_for_ever(orbit):
    """One photo has a single pair of three points: none will hold it."""
    events: list[ModelEvent] = []
    atlas = Atlas(SceneFeed(orbit).scene, OPTIONS, events.append)
    feed = SceneFeed(orbit, atlas.view_graph)
    for index in range(NUM_PHOTOS - 1):
        atlas.add(feed.add(index))
    lonely = poor_pair(orbit, feed)
    atlas.add(lonely)
    atlas.refine_until_stable()
    assert atlas.waiting == [lonely]
    events.clear()
    restart = Restart(atlas)
    while restart.go_on():
        pass
    assert atlas.waiting == [lonely]
    dropped = [event for event in events if isinstance(event, ModelDropped)]
    assert {event.reason for event in dropped} == {DropReason.NO_BETTER}
    assert len(dropped) <= OPTIONS.cheap_restarts // NUM_PHOTOS


def test_a_large_model_is_not_begun_again_for_photos_with_few_pairs(orbit):
    atlas = Atlas(SceneFeed(orbit).scene, replace(OPTIONS, cheap_restarts=0))
    feed = SceneFeed(orbit, atlas.view_graph)
    for index in range(NUM_PHOTOS - 1):
        atlas.add(feed.add(index))
    atlas.add(poor_pair(orbit, feed))
    assert not Restart(atlas).go_on()


def poor_pair(orbit: SyntheticScene, feed: SceneFeed) -> int:
    image_id = NUM_PHOTOS
    pair = true_pair(orbit, NUM_PHOTOS - 1, NUM_PHOTOS - 2, (image_id, image_id - 1))
    pair.two_view_geometry.inlier_matches = pair.matches[:3]
    keypoints = orbit.photo(NUM_PHOTOS - 1).features.keypoints
    feed.scene.add(image_id, orbit.name(NUM_PHOTOS - 1), feed.camera, keypoints, [pair])
    return image_id
