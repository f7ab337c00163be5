"""Where models stand in the scene, and what is drawn of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sfm_front.live_page import scenery
from sfm_front.live_page.arrangement import EXTENT, Arrangement, up_of
from sfm_front.live_page.follower import Outcome, Seen
from sfm_front.live_page.model_shapes import ModelShape
from sfm_front.live_page.palette import NEWEST, WEAK, linear, of_model
from sfm_front.live_page.scene_view import view_of
from sfm_front.live_page.scenery import SceneMaker
from sfm_front.reports.story import PhotoState, PhotoStory, Story


def shape(count: int = 12, *, scale: float = 1.0, turn=None, **changes: object) -> ModelShape:
    """A flight over level ground that looks down; ``turn`` (3, 3) of the whole world."""
    turn = np.eye(3) if turn is None else turn
    rng = np.random.default_rng(count)
    angles = np.linspace(0, 5, count)
    centres = np.stack([20 * np.cos(angles), 15 * np.sin(angles), np.full(count, 30.0)], axis=1)
    points = rng.uniform([-25, -20, 0], [25, 20, 3], size=(600, 3))
    down = np.tile(np.diag([1.0, -1.0, -1.0]), (count, 1, 1))
    made = ModelShape(
        model_id=1,
        image_ids=np.arange(1, count + 1),
        names=[f"{count}_{place}.jpg" for place in range(count)],
        centres=scale * centres @ turn.T,
        rotations=turn @ down,
        sizes=np.tile([0.4, 0.3, 0.8], (count, 1)),
        num_observed=np.full(count, 100),
        points=scale * points @ turn.T,
        colors=np.full((600, 3), 90, np.uint8),
        num_points=600,
        is_enu=False,
    )
    return replace(made, **changes)


def seen_of(*shapes: ModelShape, story: Story | None = None) -> Seen:
    outcomes = {
        name: Outcome(PhotoStory(name, PhotoState.PLACED), PhotoState.PLACED, place)
        for place, one in enumerate(shapes)
        for name in one.names
    }
    return Seen(story or Story(), shapes, [], outcomes)


def rotation(seed: int) -> np.ndarray:
    random, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return random * np.sign(np.linalg.det(random))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_any_model_is_of_a_handy_size_and_upright(seed, scale):
    one = shape(scale=scale, turn=rotation(seed))
    (placement,) = Arrangement().place([one])
    points = placement.points(np.concatenate([one.points, one.centres]))
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    assert EXTENT < diagonal < 1.4 * EXTENT  # The middle 96 % along each axis have the extent.
    assert placement.rotation @ up_of(one) == pytest.approx([0, 0, 1], abs=1e-9)
    assert np.linalg.det(placement.rotation) == pytest.approx(1)
    # The photos are above the ground.
    assert placement.points(one.centres)[:, 2].min() > np.median(points[:, 2])


def test_a_model_stays_where_it_is_until_it_no_longer_fits():
    arrangement = Arrangement()
    (first,) = arrangement.place([shape(scale=1.0)])
    assert arrangement.place([shape(scale=1.3)]) == [first]
    (second,) = arrangement.place([shape(scale=1.8)])
    assert second is not first
    (third,) = arrangement.place([shape(scale=1.8, is_enu=True)])
    assert third is not second


def test_models_without_a_common_frame_stand_apart():
    main, other = shape(20), shape(5, model_id=2, turn=rotation(1))
    one, two = Arrangement().place([main, other])
    assert one.points(main.points)[:, 0].max() < two.points(other.points)[:, 0].min() + 1
    low, high = np.percentile(two.points(other.points)[:, 0], (5, 95))
    assert np.percentile(one.points(main.points)[:, 0], 95) < low < high


def test_models_in_metres_keep_their_places():
    main, other = shape(20, is_enu=True), shape(5, model_id=2, is_enu=True)
    one, two = Arrangement().place([main, other])
    assert one is two


def test_cameras_have_the_colours_of_their_states():
    main, other = shape(6), shape(3, model_id=2)
    seen = seen_of(main, other)
    weak, newest = main.names[1], main.names[4]
    seen.story.newest = PhotoStory(newest)
    seen.outcomes[weak] = replace(seen.outcomes[weak], is_weak=True)
    cameras = SceneMaker().make(seen).cameras
    colors = [tuple(color) for color in cameras.colors.tolist()]
    expected = [of_model(0)] * 6 + [of_model(1)] * 3
    expected[1], expected[4] = WEAK, NEWEST
    assert colors == expected


def test_links_lead_to_the_photos_that_match():
    one = shape(6)
    seen = seen_of(one)
    newest = PhotoStory(one.names[0], links={one.names[3]: 9}, similar=(*one.names[2:4], "gone"))
    seen.story.newest = newest
    made = SceneMaker().make(seen)
    assert made.links == pytest.approx(made.cameras.centres[[[0, 3]]])
    assert made.proposals == pytest.approx(made.cameras.centres[[[0, 2]]])


def test_photos_that_wait_are_marked_where_they_match_best():
    one = shape(6)
    seen = seen_of(one)
    for number, links in enumerate(({one.names[2]: 5, one.names[4]: 8}, {one.names[4]: 3}, {})):
        photo = PhotoStory(f"wait{number}", links=links)
        seen.outcomes[photo.name] = Outcome(photo, PhotoState.WAITING, None, "why")
    made = SceneMaker().make(seen)
    assert made.gap_counts == [2]
    assert made.gaps == pytest.approx(made.cameras.centres[[4]])


def test_there_is_ground_in_metres_alone():
    assert SceneMaker().make(seen_of(shape())).ground is None
    made = SceneMaker().make(seen_of(shape(is_enu=True)))
    width = (made.ground.high - made.ground.low)[0] / made.ground.metre
    assert width == pytest.approx(50, rel=0.1)


def test_points_are_thinned_to_what_a_browser_can_draw(monkeypatch):
    monkeypatch.setattr(scenery, "MOST_POINTS", 100)
    made = SceneMaker().make(seen_of(shape()))
    assert made.points.shape == made.colors.shape == (100, 3)


def test_a_ray_finds_the_camera_it_meets_first():
    cameras = SceneMaker().make(seen_of(shape())).cameras
    for place in range(len(cameras.names)):
        middle = (
            cameras.centres[place] + 0.7 * cameras.sizes[place, 2] * cameras.rotations[place][:, 2]
        )
        start = np.array([30.0, 20.0, 25.0])
        towards = (middle - start) / np.linalg.norm(middle - start)
        assert cameras.along(start, towards) == place
    assert cameras.along(np.zeros(3), np.array([0, 0, -1.0])) is None


def test_all_of_it_is_in_view():
    made = SceneMaker().make(seen_of(shape(turn=rotation(2))))
    view = view_of(made)
    forward = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    right = np.cross(forward, view.up)
    offset = made.cameras.segments().reshape(-1, 3) - view.eye
    depth = offset @ forward
    tangent = np.tan(np.radians(22.5))
    assert depth.min() > 0
    assert np.abs(offset @ view.up / depth).max() < tangent
    assert np.abs(offset @ right / depth).max() < 1.4 * tangent


def test_lines_have_their_colours_in_linear_light():
    assert linear((0, 255, 188)).tolist() == [0, 255, 128]
