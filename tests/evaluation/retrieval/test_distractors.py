"""Distractors: vectors and features like those of photos, and of no photo."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.bench_photos import NUM_FEATURES, bench_photo

from sfm_front.evaluation.retrieval.distractor_vectors import VectorMaker
from sfm_front.evaluation.retrieval.distractors import WithDistractors
from sfm_front.features.global_descriptors.unit_vectors import unit_length
from sfm_front.matching.nearest_neighbors import MatchingOptions, match_descriptors

SCENES, PHOTOS_A_SCENE, DIMENSION = 6, 5, 512


@pytest.fixture(scope="module")
def photos():
    """Scenes of photos whose vectors have much in common, more within a scene."""
    rng = np.random.default_rng(0)
    common = rng.normal(size=DIMENSION)
    made = []
    for _ in range(SCENES):
        of_scene = rng.normal(size=DIMENSION)
        for _ in range(PHOTOS_A_SCENE):
            vector = common + of_scene + 0.5 * rng.normal(size=DIMENSION)
            made.append(bench_photo(len(made) + 1, unit_length(vector.astype(np.float32)), rng))
    return made


def test_a_distractor_is_as_near_to_a_photo_as_another_scene_is(photos):
    vectors = np.stack([photo.vectors["v"] for photo in photos])
    scene = np.arange(len(photos)) // PHOTOS_A_SCENE
    unrelated = (vectors @ vectors.T)[scene[:, None] != scene]
    maker = VectorMaker(vectors)
    made = np.stack([maker.make(np.random.default_rng(i)) for i in range(50)])
    np.testing.assert_allclose(np.linalg.norm(made, axis=1), 1, atol=1e-5)
    cosines = made @ vectors.T
    assert abs(np.median(cosines) - np.median(unrelated)) < 0.05
    bare_mean = unit_length(vectors.mean(axis=0)) @ vectors.T
    assert np.median(bare_mean) > np.median(unrelated) + 0.15
    assert cosines.max() < (vectors @ vectors.T)[scene[:, None] == scene].min()


def test_where_photos_have_nothing_in_common_distractors_have_not_either():
    rng = np.random.default_rng(0)
    vectors = unit_length(rng.normal(size=(40, 4096)).astype(np.float32))
    made = np.stack([VectorMaker(vectors).make(np.random.default_rng(i)) for i in range(20)])
    assert np.abs(np.median(made @ vectors.T)) < 0.02
    assert np.abs(made @ vectors.T).max() < 0.3
    # A number of a distractor varies as much as one of a photo.
    assert made.std() == pytest.approx(vectors.std(), rel=0.02)


def test_equal_vectors_stay_as_they_are():
    vectors = np.tile(unit_length(np.ones(100, np.float32)), (3, 1))
    np.testing.assert_allclose(
        VectorMaker(vectors).make(np.random.default_rng(0)), vectors[0], atol=1e-5
    )


def test_distractors_come_after_the_photos_and_are_the_same_again(photos):
    filled = WithDistractors(photos, 100, 50)
    assert len(filled) == 100
    assert list(filled)[: len(photos)] == photos
    again = WithDistractors(photos, 100, 50)[99]
    last = filled[-1]
    np.testing.assert_array_equal(last.vectors["v"], again.vectors["v"])
    np.testing.assert_array_equal(last.view.features.descriptors, again.view.features.descriptors)
    assert not np.array_equal(last.vectors["v"], filled[98].vectors["v"])
    assert len({photo.view.image_id for photo in filled}) == 100
    assert [photo.view.image_id for photo in filled[98:]] == [
        filled[98].view.image_id,
        last.view.image_id,
    ]
    with pytest.raises(IndexError):
        filled[100]
    assert len(WithDistractors(photos, 3, 50)) == len(photos)


def test_features_of_distractors_are_windows_on_one_pool(photos):
    filled = WithDistractors(photos, 100, 50)
    first, second = filled[50].view.features, filled[51].view.features
    assert len(first) == len(second) == 50
    assert first.descriptors.base is second.descriptors.base is not None
    assert (first.keypoints[:, :2] >= 0).all()
    assert (first.keypoints[:, :2] < [640, 480]).all()


def test_a_distractor_has_nobodys_descriptors(photos):
    pool = WithDistractors(photos, 100, 10**6)[-1].view.features
    assert len(pool) == len(photos) * NUM_FEATURES
    own = photos[0].view.features.descriptors
    copies = match_descriptors(
        own, pool.descriptors, MatchingOptions(max_angle_rad=0.3, max_ratio=1.0)
    )
    assert len(copies) == 0
