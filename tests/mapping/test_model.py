"""One model over photos with known poses and true matches."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from helpers.photo_stream import SceneFeed, position_errors_m, true_pair

from sfm_front.errors import ConfigError
from sfm_front.evaluation.poses import pose_errors
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.mapping.mapper_options import (
    ConvergenceOptions,
    InitialPairConstraints,
    MapperOptions,
)
from sfm_front.mapping.model import Model
from sfm_front.mapping.refinement_schedule import ScheduleOptions

DEMANDS = InitialPairConstraints(min_angle_deg=10, min_inliers=50)
# The photos stand on a circle of 40 m; 0.5 px of noise are 15 mm on the surface they see.
POSITION_TOLERANCE_M = 0.15
POSE_TOLERANCE_DEG = 0.5
NOISE_PX = 0.5
# Of the mean reprojection error, whose expectation is NOISE_PX times sqrt(pi / 2), less what the
# fit takes up.
ERROR_TOLERANCE_PX = 0.2


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(14, 500, seed=3, layout="orbit", noise_px=NOISE_PX)


def started(feed: SceneFeed) -> Model:
    """Of images 1 and 2. COLMAP triangulates no point that two photos alone show: a third one,
    not registered yet, must be there."""
    model = Model(feed.scene, MapperOptions(num_threads=1))
    assert model.initialize(2, 1, DEMANDS)
    return model


def test_a_model_starts_from_two_photos(orbit):
    feed = SceneFeed(orbit)
    feed.add_all(range(4))
    model = started(feed)
    assert model.registered == {1, 2}
    assert model.num_registered == 2
    assert model.num_points >= 50
    assert model.num_visible_points(3) > 30


def test_it_grows_over_all_photos_and_their_poses_are_true(orbit):
    feed = SceneFeed(orbit)
    ids = feed.add_all(range(14))
    model = started(feed)
    placed = model.grow(ids)
    assert sorted(placed) == ids[2:]
    assert model.registered == set(ids)
    model.refine()
    assert position_errors_m(model.reconstruction, orbit).max() < POSITION_TOLERANCE_M
    assert pose_errors(orbit.truth(), [model.reconstruction]).max() < POSE_TOLERANCE_DEG
    error = model.reconstruction.compute_mean_reprojection_error()
    assert error == pytest.approx(NOISE_PX, abs=ERROR_TOLERANCE_PX)


def test_it_grows_photo_by_photo_as_they_arrive(orbit):
    """Refined as a whole after each, which may take photos out again: where pycolmap's counts of
    later photos go wrong if they are not begun afresh."""
    feed = SceneFeed(orbit)
    feed.add_all([0, 1, 2])
    model = started(feed)
    for index in range(3, 14):
        before = model.registered
        image_id = feed.add(index)
        model.extend(image_id)
        model.grow(range(1, image_id + 1))
        model.refine()
        assert before <= model.registered
    model.forget_failures()
    model.grow(range(1, 15))
    model.refine()
    assert model.registered == set(range(1, 15))
    assert position_errors_m(model.reconstruction, orbit).max() < POSITION_TOLERANCE_M


def test_a_pair_without_parallax_starts_nothing(orbit):
    feed = SceneFeed(orbit)
    feed.add_all(range(3))
    steep = InitialPairConstraints(min_angle_deg=60, min_inliers=50)
    assert not Model(feed.scene, MapperOptions()).initialize(2, 1, steep)


def test_a_pair_with_few_matches_starts_nothing(orbit):
    feed = SceneFeed(orbit)
    feed.add_all(range(3))
    assert Model(feed.scene, MapperOptions()).initialize(2, 1, DEMANDS)
    many = InitialPairConstraints(min_angle_deg=10, min_inliers=10_000)
    assert not Model(feed.scene, MapperOptions()).initialize(2, 1, many)


def test_a_start_with_few_points_is_rejected(orbit):
    feed = SceneFeed(orbit)
    feed.add_all(range(3))
    many = replace(DEMANDS, min_points=5_000)
    assert not Model(feed.scene, MapperOptions()).initialize(2, 1, many)


def two_cameras(orbit, wrong: int) -> tuple[Model, list[int]]:
    """Eight photos, the last ``wrong`` of them by a second camera; intrinsics are held."""
    feed = SceneFeed(orbit)
    ids = feed.add_all(range(8 - wrong))
    feed.use_another_camera()
    ids += feed.add_all(range(8 - wrong, 8))
    model = Model(feed.scene, MapperOptions(num_threads=1, refine_intrinsics=False))
    assert model.initialize(2, 1, DEMANDS)
    model.grow(set(ids) - model.registered)
    assert model.registered == set(ids)
    model.reconstruction.camera(2).focal_length *= 100
    return model, ids


def test_a_photo_whose_camera_cannot_be_is_not_in_the_finished_model(orbit):
    model, ids = two_cameras(orbit, wrong=2)
    assert not model.is_miscalibrated
    model.finish()
    assert model.registered == set(ids[:-2])


def test_a_model_most_of_whose_cameras_cannot_be_says_so_and_keeps_its_photos(orbit):
    model, ids = two_cameras(orbit, wrong=5)
    assert model.is_miscalibrated
    model.finish()
    assert model.registered == set(ids)


def test_a_finished_model_still_says_what_waiting_photos_see_of_it(orbit):
    feed = SceneFeed(orbit)
    ids = feed.add_all(range(8))
    model = started(feed)
    model.grow(ids[:6])
    model.finish()
    assert ids[7] not in model.registered
    assert model.num_visible_points(ids[6]) > 30


def test_photos_that_see_nothing_of_it_are_left_alone(orbit):
    feed = SceneFeed(orbit)
    feed.add_all([0, 1, 2])
    behind = feed.add(8)
    model = started(feed)
    assert model.num_visible_points(behind) == 0
    assert model.grow([behind]) == []
    assert model.register_structure_less([behind]) == []
    assert model.registered == {1, 2}


def test_a_photo_that_fits_nowhere_is_tried_again_only_when_it_sees_more(orbit, monkeypatch):
    feed = SceneFeed(orbit)
    feed.add_all([0, 1, 2])
    model = started(feed)
    tried = []

    def refuse(_options: object, image_id: int) -> bool:
        tried.append(image_id)
        return False

    class Refusing:
        """The mapper, except that no photo fits."""

        def __init__(self, mapper: object) -> None:
            self._mapper = mapper

        def __getattr__(self, name: str) -> object:
            return refuse if name == "register_next_image" else getattr(self._mapper, name)

    monkeypatch.setattr(model, "_mapper", Refusing(model._mapper))
    assert model.grow([3]) == []
    assert model.grow([3]) == []
    assert tried == [3]
    model.forget_failures()
    assert model.grow([3]) == []
    assert tried == [3, 3]


def test_matches_to_photos_without_points_are_enough_at_the_end(orbit):
    """The last photo's matches lead to keypoints that were never triangulated."""
    feed = SceneFeed(orbit)
    ids = feed.add_all(range(6))
    model = started(feed)
    model.grow(ids[2:5])
    assert model.registered == set(ids[:5])
    reconstruction = model.reconstruction
    for point_id in list(reconstruction.point3D_ids()):
        seen_by = {e.image_id for e in reconstruction.point3D(point_id).track.elements}
        if seen_by & {4, 5} and model.num_visible_points(6) > 10:
            model._mapper.observation_manager.delete_point3D(point_id)
    assert model.grow([6]) == []
    assert model.register_structure_less([6]) == [6]
    assert position_errors_m(reconstruction, orbit).max() < 2 * POSITION_TOLERANCE_M


def test_the_finder_gives_another_pair_each_time(orbit):
    feed = SceneFeed(orbit)
    feed.add_all(range(5))
    finder = Model(feed.scene, MapperOptions())
    found = [finder.find_initial_pair(DEMANDS) for _ in range(3)]
    assert None not in found
    assert len({frozenset(pair) for pair in found}) == 3
    for pair in found:
        assert min(pair) >= 1
        assert max(pair) <= 5


def test_a_model_is_the_same_to_the_bit_with_one_thread(orbit):
    poses = []
    for _ in range(2):
        feed = SceneFeed(orbit)
        ids = feed.add_all(range(8))
        model = started(feed)
        model.grow(ids)
        model.refine()
        poses.append([model.reconstruction.images[i].cam_from_world().matrix() for i in ids])
    np.testing.assert_array_equal(poses[0], poses[1])


def test_the_options_reach_pycolmap():
    convergence = ConvergenceOptions(
        local_tolerance=1e-3,
        local_iterations=7,
        global_tolerance=1e-2,
        global_iterations=9,
        global_refinements=4,
        final_tolerance=1e-7,
        large_final_tolerance=1e-8,
        last_tolerance=1e-5,
        last_change=0.02,
    )
    options = MapperOptions(
        convergence=convergence,
        schedule=ScheduleOptions(large_from=50),
        num_threads=3,
        refine_intrinsics=False,
    )
    streaming = options.streaming()
    local = streaming.get_local_bundle_adjustment().ceres.solver_options
    assert (local.function_tolerance, local.max_num_iterations) == (1e-3, 7)
    whole = streaming.get_global_bundle_adjustment().ceres.solver_options
    assert (whole.function_tolerance, whole.max_num_iterations) == (1e-2, 9)
    assert streaming.ba_global_max_refinements == 4
    final, large = (options.final(count).get_global_bundle_adjustment() for count in (49, 50))
    assert final.ceres.solver_options.function_tolerance == 1e-7
    assert large.ceres.solver_options.function_tolerance == 1e-8
    last, large_last = options.last(49), options.last(50)
    changes = {each.ba_global_max_refinement_change for each in (last, large_last)}
    assert changes == {0.02}
    assert last.ba_global_function_tolerance == 1e-5
    assert large_last.ba_global_function_tolerance == 1e-8
    robust = options.robust
    assert (robust.num_threads, robust.refine_intrinsics, robust.large_from) == (3, False, 50)


@pytest.mark.parametrize("name", [field.name for field in fields(ConvergenceOptions)])
def test_convergence_out_of_range_is_refused_by_name(name):
    with pytest.raises(ConfigError, match=f"^{name} must be at least"):
        ConvergenceOptions(**{name: -1})


@pytest.mark.parametrize("wrong", [{"retry_growth": 0.9}, {"num_threads": 0}])
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        MapperOptions(**wrong)


def test_a_model_of_no_points_cannot_be_asked_for():
    with pytest.raises(ConfigError, match="min_points"):
        InitialPairConstraints(min_angle_deg=10, min_inliers=50, min_points=0)


def test_pairs_that_come_late_place_the_photo_they_lead_to(orbit):
    feed = SceneFeed(orbit)
    feed.add_all(range(4))
    keypoints = orbit.photo(4).features.keypoints
    feed.scene.add(5, orbit.name(4), feed.camera, keypoints, [])
    model = started(feed)
    model.grow(range(1, 6))
    assert model.registered == {1, 2, 3, 4}
    feed.scene.add_pairs([true_pair(orbit, 4, other, (5, other + 1)) for other in (2, 3)])
    model.take_pairs([3, 4, 5])
    assert model.grow([5]) == [5]
    assert position_errors_m(model.reconstruction, orbit).max() < POSITION_TOLERANCE_M


def test_pairs_that_come_late_between_registered_photos_add_observations(orbit):
    feed = SceneFeed(orbit, max_distance=1)
    ids = feed.add_all(range(8))
    model = started(feed)
    model.grow(ids)
    assert model.registered == set(ids)
    model.refine()
    before = model.reconstruction.compute_num_observations()
    feed.scene.add_pairs([true_pair(orbit, i + 1, i - 1, (i + 2, i)) for i in range(1, 7)])
    model.take_pairs(ids)
    model.refine()
    assert model.reconstruction.compute_num_observations() > 1.1 * before
    assert position_errors_m(model.reconstruction, orbit).max() < POSITION_TOLERANCE_M


def test_points_that_two_photos_alone_show_are_taken_if_asked_for(orbit):
    feed = SceneFeed(orbit)
    ids = feed.add_all(range(5))
    model = started(feed)
    before = model.num_points
    model.take_two_view_tracks()
    assert before < model.num_points <= len(feed.scene.matches(2, 1))
    model.refine()
    model.grow(ids)
    assert model.registered == set(ids)
    assert position_errors_m(model.reconstruction, orbit).max() < POSITION_TOLERANCE_M
