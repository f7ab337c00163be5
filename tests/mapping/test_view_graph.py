"""The scene that models are grown over: who is linked to whom, and mappers that see new photos."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import SceneFeed, centre_of, true_matches, true_pair

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.mapping.view_graph import ViewGraph


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(16, 250, seed=1, layout="orbit")


@pytest.fixture
def feed(orbit) -> SceneFeed:
    """Image ids 1 to 5: four photos in a row and one from the other side."""
    feed = SceneFeed(orbit)
    assert feed.add_all([0, 1, 2, 3, 8]) == [1, 2, 3, 4, 5]
    return feed


def test_photos_stand_in_the_order_of_arrival(feed):
    assert feed.scene.image_ids == [1, 2, 3, 4, 5]
    assert len(feed.scene) == 5


def test_neighbors_are_those_with_a_verified_pair(orbit, feed):
    expected = {i: len(true_matches(orbit, 1, feed.index_of[i])) for i in (1, 3, 4)}
    assert feed.scene.neighbors(2) == expected
    assert feed.scene.neighbors(5) == {}


def test_pairs_come_strongest_first_the_later_photo_in_front(feed):
    pairs = feed.scene.pairs({1, 2, 3, 5})
    assert sorted(pairs) == [(2, 1), (3, 1), (3, 2)]
    inliers = [feed.scene.neighbors(i)[j] for i, j in pairs]
    assert inliers == sorted(inliers, reverse=True)
    assert len(set(inliers)) == 3
    assert feed.scene.pairs({1}) == []


def test_the_angle_of_a_pair_is_in_degrees(orbit, feed):
    # On a circle, photos seen from its middle stand a sixteenth of a turn apart.
    towards = [centre_of(orbit.cams_from_world[i]) for i in (0, 1)]
    cosine = towards[0] @ towards[1] / np.prod([np.linalg.norm(v) for v in towards])
    assert feed.scene.angle_deg((2, 1)) == pytest.approx(np.degrees(np.arccos(cosine)), rel=0.4)


def test_the_angle_of_a_pair_without_a_relative_pose_is_unknown(orbit):
    pair = true_pair(orbit, 0, 1, (2, 1))
    pair.two_view_geometry.tri_angle = -1
    scene = ViewGraph()
    for image_id in (1, 2):
        keypoints = orbit.photo(2 - image_id).features.keypoints
        camera = pycolmap.Camera(orbit.camera.todict())
        scene.add(image_id, f"{image_id}.jpg", camera, keypoints, [pair] if image_id == 2 else [])
    assert scene.angle_deg((2, 1)) is None


def test_components_follow_the_pairs(feed):
    assert feed.scene.component([1]) == {1, 2, 3, 4}
    assert feed.scene.component([5]) == {5}
    assert feed.scene.component([1, 5]) == {1, 2, 3, 4, 5}
    assert feed.scene.component([1], among={2, 5}) == {1, 2}


def test_a_mapper_knows_the_photos_there_are(feed):
    _, model = feed.scene.new_mapper()
    assert sorted(model.images) == [1, 2, 3, 4, 5]
    assert model.num_reg_images() == 0
    assert model.images[2].name == "000001.jpg"
    assert model.images[2].num_points2D() == len(feed.synthetic.photo(1).features)


def test_a_mapper_can_be_told_of_later_photos(feed):
    mapper, model = feed.scene.new_mapper()
    image_id = feed.add(4)
    feed.scene.extend(mapper, model, image_id)
    assert sorted(model.images) == [1, 2, 3, 4, 5, 6]
    # The new photo's matches count as if it had been there from the start.
    fresh, _ = feed.scene.new_mapper()
    manager = fresh.observation_manager
    assert manager.num_correspondences(6) > 0
    assert mapper.observation_manager.num_correspondences(6) == manager.num_correspondences(6)
    for earlier in (3, 4):
        assert mapper.observation_manager.num_correspondences(
            earlier
        ) == manager.num_correspondences(earlier)


def test_a_later_photo_may_bring_a_new_camera(orbit, feed):
    mapper, model = feed.scene.new_mapper()
    other = SceneFeed(orbit, feed.scene)
    other.camera.camera_id = 9
    image_id = other.add(5)
    feed.scene.extend(mapper, model, image_id)
    assert sorted(model.cameras) == [1, 9]
    assert model.images[image_id].camera_id == 9


def test_points_are_the_keypoints(orbit):
    feed = SceneFeed(orbit, ViewGraph())
    feed.add(3)
    _, model = feed.scene.new_mapper()
    points = np.array([point.xy for point in model.images[1].points2D])
    np.testing.assert_array_equal(points, orbit.photo(3).features.keypoints[:, :2].astype(float))


def test_pairs_may_come_after_their_photos(orbit):
    late = SceneFeed(orbit)
    late.add(0)
    late.scene.add(2, "1.jpg", orbit.camera, orbit.photo(1).features.keypoints, [])
    assert late.scene.neighbors(1) == {}
    pair = true_pair(orbit, 1, 0, (2, 1))
    late.scene.add_pairs([pair])
    assert late.scene.pairs({1, 2}) == [(2, 1)]
    assert late.scene.neighbors(1) == {2: pair.num_inliers}


def test_pairs_keep_only_the_matches_they_are_left(feed):
    graph = feed.scene
    before = {pair: graph.matches(*pair) for pair in graph.pairs(graph.image_ids)}
    graph.keep_only({(2, 1): before[2, 1][::2], (3, 2): before[3, 2][:0]})
    assert graph.image_ids == [1, 2, 3, 4, 5]
    assert sorted(graph.pairs(graph.image_ids)) == sorted(before.keys() - {(3, 2)})
    assert graph.neighbors(1)[2] == graph.neighbors(2)[1] == len(before[2, 1][::2])
    assert 3 not in graph.neighbors(2)
    np.testing.assert_array_equal(graph.matches(2, 1), before[2, 1][::2])
    np.testing.assert_array_equal(graph.matches(4, 3), before[4, 3])
    # Photos that come later, and new mappers, see what is left.
    feed.add(4)
    _, reconstruction = graph.new_mapper()
    assert sorted(reconstruction.images) == [1, 2, 3, 4, 5, 6]
    assert graph.angle_deg((2, 1)) is not None
