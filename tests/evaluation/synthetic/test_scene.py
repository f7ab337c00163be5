"""The synthetic stream: its photos agree with its truth, repeat, and overlap as a flight does."""

from __future__ import annotations

import numpy as np
import pytest

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticPhoto, SyntheticScene, make_scene

LAYOUTS = ["orbit", "strip", "ring"]
FLOAT32_PX = 1e-3  # what storing a pixel coordinate of up to 1600 as float32 may cost
RATIO = 0.8  # Lowe's ratio test


def true_pixels(scene: SyntheticScene, photo: SyntheticPhoto, index: int) -> np.ndarray:
    """Where the scene points of a photo's keypoints project, by pycolmap's own camera."""
    points = scene.points[photo.point_ids[photo.point_ids >= 0]]
    return scene.camera.img_from_cam(scene.cams_from_world[index] * points)


def shared_points(scene: SyntheticScene, first: int, second: int) -> int:
    ids = [scene.photo(index).point_ids for index in (first, second)]
    return len(np.intersect1d(ids[0][ids[0] >= 0], ids[1][ids[1] >= 0]))


def mutual_ratio_matches(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(M, 2) indices of mutual nearest neighbours that pass the ratio test on angles."""
    a, b = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (first * 1.0, second * 1.0))
    cosine = a @ b.T
    angles = np.sort(np.arccos(np.clip(cosine, -1, 1)), axis=1)
    best = cosine.argmax(axis=1)
    rows = np.flatnonzero(
        (cosine.argmax(axis=0)[best] == np.arange(len(a))) & (angles[:, 0] < RATIO * angles[:, 1])
    )
    return np.column_stack([rows, best[rows]])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_keypoints_are_projections_of_the_true_points(layout):
    scene = make_scene(12, 300, seed=1, layout=layout, noise_px=0.0)
    for index in (0, 7, 11):
        photo = scene.photo(index)
        seen = photo.features.keypoints[photo.point_ids >= 0, :2]
        assert len(seen) > 100
        np.testing.assert_allclose(seen, true_pixels(scene, photo, index), atol=FLOAT32_PX)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_noise_has_the_deviation_asked_for(layout):
    scene = make_scene(8, 2000, seed=2, layout=layout, noise_px=0.7)
    photo = scene.photo(3)
    seen = photo.features.keypoints[photo.point_ids >= 0, :2]
    error = seen - true_pixels(scene, photo, 3)
    assert error.std() == pytest.approx(0.7, rel=0.1)
    assert abs(error.mean()) < 0.1


def test_every_photo_is_a_valid_feature_set():
    scene = make_scene(10, 400, seed=3)
    for index in range(len(scene)):
        photo = scene.photo(index)
        features = photo.features
        count = len(features)
        assert features.keypoints.shape == (count, 4)
        assert features.keypoints.dtype == np.float32
        assert features.descriptors.shape == (count, 128)
        assert features.descriptors.dtype == np.uint8
        assert features.colors.shape == (count, 3)
        assert photo.point_ids.shape == (count,)
        assert (features.keypoints[:, 2] > 0).all()
        lengths = np.linalg.norm(features.descriptors.astype(float), axis=1)
        assert np.percentile(np.abs(lengths - 512), 99) < 60
        visible = photo.point_ids[photo.point_ids >= 0]
        assert len(np.unique(visible)) == len(visible)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_photos_are_the_same_whenever_they_are_asked_for(layout):
    first = make_scene(6, 200, seed=4, layout=layout)
    second = make_scene(6, 200, seed=4, layout=layout)
    second.photo(1)
    a, b = first.photo(5), second.photo(5)
    np.testing.assert_array_equal(a.features.keypoints, b.features.keypoints)
    np.testing.assert_array_equal(a.features.descriptors, b.features.descriptors)
    np.testing.assert_array_equal(a.point_ids, b.point_ids)
    other = make_scene(6, 200, seed=5, layout=layout).photo(5)
    assert not np.array_equal(a.features.keypoints[:50], other.features.keypoints[:50])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_neighbours_share_points(layout):
    scene = make_scene(24, 500, seed=6, layout=layout, repeatability=1.0)
    assert shared_points(scene, 0, 1) > 200


def test_far_photos_of_a_strip_share_nothing():
    scene = make_scene(100, 300, seed=7, layout="strip")
    assert shared_points(scene, 0, len(scene) - 1) == 0


def test_a_strip_photo_sees_as_much_in_a_long_flight_as_in_a_short_one():
    counts = []
    for num_images in (30, 600):
        scene = make_scene(num_images, 500, seed=8, layout="strip")
        middle = range(num_images // 2, num_images // 2 + 10)
        counts.append(np.mean([len(scene.photo(index).features) for index in middle]))
    assert counts[1] == pytest.approx(counts[0], rel=0.15)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_descriptors_match_the_same_point_and_hardly_anything_else(layout):
    scene = make_scene(24, 500, seed=9, layout=layout, outlier_ratio=0.0)
    first, second = scene.photo(4), scene.photo(5)
    matches = mutual_ratio_matches(first.features.descriptors, second.features.descriptors)
    ids = first.point_ids[matches[:, 0]], second.point_ids[matches[:, 1]]
    right = (ids[0] == ids[1]) & (ids[0] >= 0)
    assert right.mean() > 0.99
    assert right.sum() > 0.95 * shared_points(scene, 4, 5)


def test_misplaced_points_make_the_asked_for_share_of_wrong_matches():
    scene = make_scene(24, 1000, seed=10, outlier_ratio=0.2)
    first, second = scene.photo(4), scene.photo(5)
    matches = mutual_ratio_matches(first.features.descriptors, second.features.descriptors)
    ids = first.point_ids[matches[:, 0]], second.point_ids[matches[:, 1]]
    wrong = (ids[0] != ids[1]) | (ids[0] < 0)
    # Right only if neither end is misplaced.
    assert wrong.mean() == pytest.approx(1 - 0.8**2, abs=0.06)


def test_background_has_the_asked_for_share():
    scene = make_scene(6, 1000, seed=11, background_ratio=0.4)
    ids = scene.photo(2).point_ids
    assert np.mean(ids < 0) == pytest.approx(0.4, abs=0.01)


def test_the_strongest_keypoints_of_neighbours_overlap():
    scene = make_scene(24, 800, seed=12, repeatability=1.0, background_ratio=0.0)
    first, second = (scene.photo(index).point_ids for index in (4, 5))
    both = np.intersect1d(first, second)
    of_strongest = len(np.intersect1d(first[:200], second[:200]))
    # Were strength drawn anew for each photo, a quarter of each half that overlaps would meet.
    assert of_strongest > 0.5 * 200 * len(both) / len(first)


def test_truth_has_every_pose_under_its_photos_name():
    scene = make_scene(5, 50, seed=13)
    model = scene.truth()
    assert model.num_reg_images() == 5
    for index in range(5):
        image = model.find_image_with_name(scene.photo(index).name)
        np.testing.assert_allclose(
            image.cam_from_world().matrix(), scene.cams_from_world[index].matrix()
        )


@pytest.mark.parametrize(
    "wrong",
    [
        {"num_images": 0},
        {"points_per_image": 0},
        {"noise_px": -1.0},
        {"outlier_ratio": 1.0},
        {"background_ratio": -0.1},
        {"repeatability": 0.0},
        {"layout": "spiral"},
    ],
)
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        make_scene(**({"num_images": 3} | wrong))
