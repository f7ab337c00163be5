"""Adjustment around new photos: as COLMAP's for one of them, and shared in large models."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import SceneFeed

from sfm_front.errors import ConfigError
from sfm_front.evaluation.poses import pose_errors
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.mapping.local_refinement import LocalRefinement, LocalRefinementOptions
from sfm_front.mapping.mapper_options import MapperOptions

NUM_PHOTOS = 8
POSE_TOLERANCE_DEG = 0.02
OPTIONS = MapperOptions(num_threads=1).streaming()
Refine = Callable[[pycolmap.IncrementalMapper, int], None]


def orbit() -> SceneFeed:
    return SceneFeed(make_scene(14, 500, seed=3, layout="orbit", noise_px=0.5))


def grown(refine: Refine, feed: SceneFeed | None = None) -> pycolmap.Reconstruction:
    """A model of an orbit after two photos and then one more at a time, each refined around."""
    feed = feed or orbit()
    feed.add_all(range(NUM_PHOTOS))
    mapper, model = feed.scene.new_mapper()
    mapping, triangulation = OPTIONS.get_mapper(), OPTIONS.get_triangulation()
    mapping.init_min_tri_angle, mapping.init_min_num_inliers = 8, 50
    pose = mapper.estimate_initial_two_view_geometry(mapping, 2, 1)
    mapper.register_initial_image_pair(mapping, 2, 1, pose)
    for image_id in (1, 2):
        mapper.triangulate_image(triangulation, image_id)
    mapper.adjust_global_bundle(mapping, OPTIONS.get_global_bundle_adjustment())
    mapper.clear_modified_points3D()
    for image_id in range(3, NUM_PHOTOS + 1):
        assert mapper.register_next_image(mapping, image_id)
        mapper.triangulate_image(triangulation, image_id)
        refine(mapper, image_id)
    return model


def by_colmap(mapper: pycolmap.IncrementalMapper, image_id: int) -> None:
    mapper.iterative_local_refinement(
        1,
        OPTIONS.ba_local_max_refinement_change,
        OPTIONS.get_mapper(),
        OPTIONS.get_local_bundle_adjustment(),
        OPTIONS.get_triangulation(),
        image_id,
    )
    mapper.clear_modified_points3D()


def test_around_one_photo_it_is_what_colmap_does():
    ours = LocalRefinement(OPTIONS)
    mine, theirs = grown(ours.add), grown(by_colmap)
    assert mine.num_points3D() == theirs.num_points3D() > 100
    assert mine.compute_num_observations() == theirs.compute_num_observations()
    # The three points that hold the model may be others: its place is free, its shape is not.
    assert pose_errors(theirs, [mine]).max() < POSE_TOLERANCE_DEG
    unrefined = grown(lambda mapper, _: mapper.clear_modified_points3D())
    assert pose_errors(theirs, [unrefined]).max() > 5 * POSE_TOLERANCE_DEG


def test_photos_of_a_large_model_share_an_adjustment(monkeypatch):
    monkeypatch.setattr(LocalRefinementOptions, "batch_size", lambda *_: 3)
    adjusted: list[int] = []
    ours = LocalRefinement(OPTIONS)

    def add(mapper: pycolmap.IncrementalMapper, image_id: int) -> None:
        ours.add(mapper, image_id)
        adjusted.append(len(mapper.get_modified_points3D()))

    together = grown(add)
    # Of six photos the third and the sixth: what changed before is kept for them.
    assert [count > 0 for count in adjusted] == [True, True, False, True, True, False]
    assert together.compute_mean_reprojection_error() == pytest.approx(
        grown(by_colmap).compute_mean_reprojection_error(), rel=0.05
    )


def test_apart_from_a_huge_model_it_is_the_same_to_the_bit(monkeypatch):
    # Not all photos are in a bundle: some stand fixed.
    monkeypatch.setattr(OPTIONS.mapper, "ba_local_num_images", 3)
    whole = grown(LocalRefinement(OPTIONS).add)
    monkeypatch.setattr(LocalRefinementOptions, "is_apart", lambda *_: True)
    feed, parts = orbit(), []

    def part(*given: object) -> pycolmap.Reconstruction:
        parts.append(feed.scene.part(*given))
        return parts[-1]

    apart = grown(LocalRefinement(OPTIONS, part=part).add, feed)
    assert len(parts) == NUM_PHOTOS - 2
    assert any(one.num_points3D() < apart.num_points3D() for one in parts)
    for image_id in whole.reg_image_ids():
        np.testing.assert_array_equal(
            apart.image(image_id).cam_from_world().matrix(),
            whole.image(image_id).cam_from_world().matrix(),
        )
    assert sorted(apart.point3D_ids()) == sorted(whole.point3D_ids())
    for point_id in whole.point3D_ids():
        np.testing.assert_array_equal(apart.point3D(point_id).xyz, whole.point3D(point_id).xyz)
    np.testing.assert_array_equal(apart.camera(1).params, whole.camera(1).params)


def test_what_was_refined_with_the_whole_model_is_forgotten(monkeypatch):
    monkeypatch.setattr(LocalRefinementOptions, "batch_size", lambda *_: 2)
    ours = LocalRefinement(OPTIONS)
    waiting: list[bool] = []

    def add(mapper: pycolmap.IncrementalMapper, image_id: int) -> None:
        ours.add(mapper, image_id)
        if image_id == 3:
            ours.forget(mapper)
        waiting.append(len(mapper.get_modified_points3D()) > 0)

    grown(add)
    assert waiting == [False, True, False, True, False, True]


def test_the_larger_a_model_the_more_photos_share_an_adjustment():
    batch_size = LocalRefinementOptions(photos_per_batch=250).batch_size
    assert {batch_size(size) for size in range(2, 250)} == {1}
    assert batch_size(250) == 2
    # Each checks the whole model: for a photo, that stays below the check of 250 photos.
    assert all(size / batch_size(size) <= 250 for size in range(2, 1000))
    # From there on it is refined apart, and the batch is as large as it may be.
    assert {batch_size(size) for size in range(1000, 10_000, 7)} == {4}
    assert [LocalRefinementOptions().is_apart(size) for size in (999, 1000)] == [False, True]


def test_points_in_more_photos_than_the_limit_stay_fixed():
    point = pycolmap.Point3D(track=pycolmap.Track([pycolmap.TrackElement(i, 0) for i in range(5)]))
    point.error = 0.5
    for limit, moves in ((4, False), (5, True)):
        options = LocalRefinementOptions(max_track_length=limit)
        assert LocalRefinement(OPTIONS, options)._is_short(point) is moves


@pytest.mark.parametrize("name", ["photos_per_batch", "max_batch", "max_track_length"])
def test_numbers_below_one_are_refused(name):
    with pytest.raises(ConfigError, match=f"{name} must be at least 1, got 0"):
        LocalRefinementOptions(**{name: 0})
