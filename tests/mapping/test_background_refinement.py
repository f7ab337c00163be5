"""Refinement beside a session: what a copy has gained is carried over to a model that grew."""

from __future__ import annotations

import copy
import tempfile
import time
from collections.abc import Iterator

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import SceneFeed, position_errors_m

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import ModelEvent, ModelRefined
from sfm_front.mapping import background_refinement
from sfm_front.mapping.atlas import Atlas, AtlasOptions
from sfm_front.mapping.background_refinement import BackgroundAdjuster
from sfm_front.mapping.carry_over import Before, carry_over
from sfm_front.mapping.finishing import finish
from sfm_front.mapping.mapper_options import (
    ConvergenceOptions,
    InitialPairConstraints,
    MapperOptions,
)
from sfm_front.mapping.model import Model

NUM_PHOTOS = 16
OPTIONS = MapperOptions(
    num_threads=1, convergence=ConvergenceOptions(global_tolerance=1e-6, global_iterations=30)
)
# The photos stand on a circle of 40 m; 0.5 px of noise are 15 mm on the surface they see.
POSITION_TOLERANCE_M = 0.3
PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 500, seed=4, layout="orbit", noise_px=0.5)


@pytest.fixture(scope="module")
def grown(orbit) -> pycolmap.Reconstruction:
    """Ten photos, refined."""
    feed = SceneFeed(orbit)
    ids = feed.add_all(range(10))
    model = Model(feed.scene, MapperOptions(num_threads=1))
    assert model.initialize(2, 1, InitialPairConstraints(min_angle_deg=10, min_inliers=50))
    model.grow(ids)
    model.refine()
    return model.reconstruction


@pytest.fixture
def adjuster() -> Iterator[BackgroundAdjuster]:
    with BackgroundAdjuster() as adjuster:
        yield adjuster


def wait_for(adjuster: BackgroundAdjuster) -> None:
    until = time.monotonic() + PATIENCE_S
    while not adjuster.is_free and not adjuster.is_broken and time.monotonic() < until:
        adjuster.poll()
        time.sleep(0.01)


def shaken(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """A copy whose points are off by some pixels."""
    off = copy.deepcopy(model)
    rng = np.random.default_rng(0)
    for point in off.points3D.values():
        point.xyz = point.xyz + rng.normal(0, 0.01, 3)
    return off


def mean_error_px(model: pycolmap.Reconstruction) -> float:
    model.update_point_3d_errors()
    return float(model.compute_mean_reprojection_error())


def test_a_copy_is_adjusted_in_another_process(grown, adjuster):
    off = shaken(grown)
    assert adjuster.is_free
    ticket = adjuster.submit(off, OPTIONS)
    assert not adjuster.is_free
    wait_for(adjuster)
    refined = adjuster.result(ticket)
    assert mean_error_px(off) > 2 * mean_error_px(grown)
    assert mean_error_px(refined) < 1.1 * mean_error_px(grown)
    # It takes the next one, and then the first has no result any more.
    later = adjuster.submit(off, OPTIONS)
    assert adjuster.result(later) is None
    wait_for(adjuster)
    assert adjuster.result(ticket) is None
    assert adjuster.result(later) is not None


def test_a_process_that_dies_is_told_and_takes_no_more(grown, adjuster, caplog):
    ticket = adjuster.submit(grown, OPTIONS)
    adjuster._process.kill()
    wait_for(adjuster)
    assert adjuster.result(ticket) is None
    assert not adjuster.is_free
    assert "the process that refines models has ended" in caplog.text


def test_a_process_that_does_not_answer_is_not_waited_for_for_ever(grown, adjuster, monkeypatch):
    monkeypatch.setattr(background_refinement, "_PATIENCE_S", 0.0)
    ticket = adjuster.submit(grown, OPTIONS)
    adjuster.poll()
    assert adjuster.is_broken
    assert adjuster.result(ticket) is None
    # It is not left to go on.
    assert adjuster._process.wait(PATIENCE_S) != 0


def moved(model: pycolmap.Reconstruction, by: pycolmap.Sim3d) -> pycolmap.Reconstruction:
    other = copy.deepcopy(model)
    other.transform(by)
    return other


def test_what_both_have_becomes_what_the_copy_has_become(grown):
    """The copy was turned and moved as a whole: poses and points follow to the digit."""
    by = pycolmap.Sim3d(1.0, pycolmap.Rotation3d([0.1, -0.2, 0.05]), [1.0, 2.0, -3.0])
    live, refined = copy.deepcopy(grown), moved(grown, by)
    carry_over(live, Before.of(grown), refined, {})
    for image_id in grown.reg_image_ids():
        np.testing.assert_allclose(
            live.image(image_id).cam_from_world().matrix(),
            refined.image(image_id).cam_from_world().matrix(),
            atol=1e-9,
        )
    for point_id in grown.point3D_ids():
        np.testing.assert_allclose(
            live.point3D(point_id).xyz, refined.point3D(point_id).xyz, atol=1e-9
        )


def test_what_came_since_moves_along(grown):
    """The copy lacked the last photo and the points that it sees first."""
    by = pycolmap.Sim3d(1.0, pycolmap.Rotation3d([0.1, -0.2, 0.05]), [1.0, 2.0, -3.0])
    newest = max(grown.reg_image_ids())
    earlier = copy.deepcopy(grown)
    earlier.deregister_frame(earlier.image(newest).frame_id)
    gone = sorted(earlier.point3D_ids())[:20]
    for point_id in gone:
        earlier.delete_point3D(point_id)
    live, refined = copy.deepcopy(grown), moved(earlier, by)
    carry_over(live, Before.of(earlier), refined, {newest: [newest - 1]})
    expected = moved(grown, by)
    np.testing.assert_allclose(
        live.image(newest).cam_from_world().matrix(),
        expected.image(newest).cam_from_world().matrix(),
        atol=1e-9,
    )
    for point_id in gone:
        np.testing.assert_allclose(
            live.point3D(point_id).xyz, expected.point3D(point_id).xyz, atol=1e-9
        )
    assert mean_error_px(live) == pytest.approx(mean_error_px(grown), rel=0.01)


def test_what_changed_since_is_kept(grown):
    """The copy's camera gained a pixel of focal length, the model's two since."""
    refined, live = copy.deepcopy(grown), copy.deepcopy(grown)
    (camera_id,) = grown.cameras
    for model, more_px in ((refined, 1.0), (live, 2.0)):
        camera = model.camera(camera_id)
        camera.params = [camera.params[0] + more_px, *camera.params[1:]]
    carry_over(live, Before.of(grown), refined, {})
    focal_px = live.camera(camera_id).params[0]
    assert focal_px == pytest.approx(grown.camera(camera_id).params[0] + 3.0)


class SlowAdjuster(BackgroundAdjuster):
    """Lets a photo or two come before a result is there."""

    def __init__(self) -> None:
        super().__init__()
        self.polls = 0

    def poll(self) -> None:
        self.polls += 1
        if self.polls % 3 == 0:
            until = time.monotonic() + PATIENCE_S
            while self.is_busy and time.monotonic() < until:
                super().poll()


def grown_atlas(
    orbit: SyntheticScene, events: list[ModelEvent], adjuster: BackgroundAdjuster | None
) -> tuple[Atlas, SceneFeed]:
    """All photos, one after the other."""
    feed = SceneFeed(orbit)
    options = AtlasOptions(mapper=MapperOptions(num_threads=2))
    atlas = Atlas(feed.scene, options, events.append, adjuster)
    for index in range(NUM_PHOTOS):
        atlas.add(feed.add(index))
    return atlas, feed


def test_photos_that_come_meanwhile_do_not_wait_and_the_model_is_as_true(orbit):
    events: list[ModelEvent] = []
    with SlowAdjuster() as adjuster:
        atlas, _ = grown_atlas(orbit, events, adjuster)
        in_stream = [event for event in events if isinstance(event, ModelRefined)]
        assert adjuster.polls > 3
        assert any(event.max_shift > 0 for event in in_stream)
        finish(atlas)
    assert [model.num_registered for model in atlas.models] == [NUM_PHOTOS]
    errors = position_errors_m(atlas.models[0].reconstruction, orbit)
    assert errors.max() < POSITION_TOLERANCE_M


def test_settling_goes_on_in_the_background(orbit):
    events: list[ModelEvent] = []
    with BackgroundAdjuster() as adjuster:
        atlas, feed = grown_atlas(orbit, events, adjuster)
        wait_for(adjuster)
        atlas.add(feed.add(0))
        events.clear()
        assert not atlas.settle()
        assert events == []
        until = time.monotonic() + PATIENCE_S
        while not atlas.settle() and time.monotonic() < until:
            time.sleep(0.01)
        (refined,) = [event for event in events if isinstance(event, ModelRefined)]
        assert refined.num_registered == NUM_PHOTOS + 1
        # Nothing is left to do.
        assert atlas.settle()
        assert not adjuster.is_busy
        assert len(events) == 1


def test_without_the_process_models_are_refined_in_the_turn_of_a_photo(orbit):
    events: list[ModelEvent] = []
    alone: list[ModelEvent] = []
    with BackgroundAdjuster() as adjuster:
        adjuster.is_broken = True
        grown_atlas(orbit, events, adjuster)
    grown_atlas(orbit, alone, None)
    refined, of_one = (
        [event.num_registered for event in told if isinstance(event, ModelRefined)]
        for told in (events, alone)
    )
    assert refined == of_one
    assert max(refined) > 8


def test_the_copies_go_with_a_session_that_is_killed(grown, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with BackgroundAdjuster() as adjuster:
        assert list(tmp_path.iterdir()) == []
        adjuster.submit(grown, OPTIONS)
        process = adjuster._process
        assert process is not None
        assert process.stdin is not None
        assert len(list(tmp_path.iterdir())) == 1
        # As the system does then.
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
        assert list(tmp_path.iterdir()) == []
