"""A large model adjusted by some of its points: as true as by all of them."""

from __future__ import annotations

import copy

import numpy as np
import pycolmap
import pytest
from helpers.lens_making import camera_of, true_model

from sfm_front.errors import ConfigError
from sfm_front.evaluation.poses import pose_errors
from sfm_front.mapping import thinned_adjustment
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions, adjust_robustly
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.mapping.thinned_adjustment import adjust_thinned, chosen_points

NOISE_PX = 0.3
OPTIONS = RobustAdjustmentOptions(num_threads=1)


@pytest.fixture
def model() -> pycolmap.Reconstruction:
    return true_model(camera_of("SIMPLE_RADIAL", [-0.05]), num_photos=12, noise_px=NOISE_PX)


@pytest.fixture
def displaced(model) -> pycolmap.Reconstruction:
    """Points, photos and the camera are off."""
    rng = np.random.default_rng(0)
    moved = copy.deepcopy(model)
    for point in moved.points3D.values():
        point.xyz = point.xyz + rng.normal(0, 0.05, 3)
    for image_id in moved.reg_image_ids():
        image = moved.image(image_id)
        pose = image.cam_from_world()
        pose.translation = pose.translation + rng.normal(0, 0.05, 3)
        moved.frame(image.frame_id).rig_from_world = pose
    camera = moved.camera(1)
    camera.params = (np.array(camera.params) * [1.02, 1, 1, 1]).tolist()
    return moved


@pytest.fixture(name="huge")
def every_model_is_huge(monkeypatch) -> None:
    """Every model counts as large, and keeps few points."""
    monkeypatch.setattr(thinned_adjustment, "HUGE", 2)
    monkeypatch.setattr(thinned_adjustment, "_POINTS_PER_PHOTO", 60)
    monkeypatch.setattr(thinned_adjustment, "_AT_A_TIME", 37)


def num_seen(model: pycolmap.Reconstruction, points: set[int]) -> list[int]:
    return [
        len(points.intersection(p.point3D_id for p in model.image(i).get_observation_points2D()))
        for i in model.reg_image_ids()
    ]


def test_each_photo_keeps_as_many_points_as_asked_for(model):
    chosen = chosen_points(model, 60)
    assert chosen == chosen_points(model, 60)
    assert len(chosen) < model.num_points3D() / 2
    assert min(num_seen(model, chosen)) >= 60


def test_a_photo_that_sees_fewer_keeps_them_all(model):
    assert chosen_points(model, 10_000) == set(model.point3D_ids())


def test_a_small_model_is_adjusted_itself(model):
    adjusted = []
    adjust_thinned(model, pycolmap.BundleAdjustmentOptions(), adjusted.append)
    assert adjusted == [model]


@pytest.mark.usefixtures("huge")
def test_poses_are_as_true_as_by_all_points(model, displaced, monkeypatch):
    by_all = copy.deepcopy(displaced)
    adjust_robustly(displaced, OPTIONS, principal_point=False)
    monkeypatch.setattr(thinned_adjustment, "HUGE", 1000)
    adjust_robustly(by_all, OPTIONS, principal_point=False)
    # A sixth of the points leaves errors that are two and a half times as large.
    thinned, whole = (np.median(pose_errors(model, [m])) for m in (displaced, by_all))
    assert thinned < 4 * whole
    assert displaced.camera(1).params == pytest.approx(by_all.camera(1).params, rel=0.01, abs=0.01)


@pytest.mark.usefixtures("huge")
def test_the_other_points_are_where_the_photos_see_them(model, displaced):
    chosen = chosen_points(displaced, 60)
    others = set(displaced.point3D_ids()) - chosen
    adjust_robustly(displaced, OPTIONS, principal_point=False)
    errors = [displaced.point3D(i).error for i in others]
    assert len(errors) > 2 * thinned_adjustment._AT_A_TIME
    # Of both coordinates; the track of a point is longer than what it has to fit.
    assert np.mean(errors) < np.sqrt(2) * NOISE_PX * 1.1
    assert displaced.num_points3D() == model.num_points3D()


@pytest.mark.usefixtures("huge")
def test_a_point_that_does_not_find_back_is_dropped(model):
    lost = min(set(model.point3D_ids()) - chosen_points(model, 60))
    image = model.image(model.point3D(lost).track.elements[0].image_id)
    # As far behind its photos as no step brings back.
    model.point3D(lost).xyz = image.projection_center() - 1e6 * image.viewing_direction()
    before = model.num_points3D()
    adjust_thinned(model, pycolmap.BundleAdjustmentOptions(print_summary=False), lambda _: None)
    model.update_point_3d_errors()
    assert model.num_points3D() in (before - 1, before)
    assert max(point.error for point in model.points3D.values()) < thinned_adjustment._LOST_PX


@pytest.mark.usefixtures("huge")
def test_what_adjusts_it_may_move_it_as_a_whole(model):
    def move(thinned: pycolmap.Reconstruction) -> None:
        assert thinned.num_points3D() < model.num_points3D()
        thinned.transform(pycolmap.Sim3d(1.0, pycolmap.Rotation3d(), np.array([3.0, 0, 0])))

    before = model.image(1).projection_center().copy()
    errors = {i: model.point3D(i).error for i in model.point3D_ids()}
    adjust_thinned(model, pycolmap.BundleAdjustmentOptions(print_summary=False), move)
    np.testing.assert_allclose(model.image(1).projection_center() - before, [3, 0, 0], atol=1e-9)
    model.update_point_3d_errors()
    assert np.mean([model.point3D(i).error for i in errors]) < 1.1 * np.mean(list(errors.values()))


def test_points_count_by_what_they_add_in_a_large_model():
    options = MapperOptions(min_coverage_gain=0.2, huge_coverage_gain=0.7, huge_from=50)
    assert [options.coverage_gain(number) for number in (49, 50)] == [0.2, 0.7]
    assert options.final(50).mapper.ba_global_prune_points_min_coverage_gain == pytest.approx(0.7)
    with pytest.raises(ConfigError, match="huge_coverage_gain must not be negative, got -1"):
        MapperOptions(huge_coverage_gain=-1)
