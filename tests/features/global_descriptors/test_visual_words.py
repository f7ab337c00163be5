"""Directions at visual words, on descriptors that lie where the test puts them."""

from __future__ import annotations

import numpy as np
from helpers.feature_making import features_of

from sfm_front.features.global_descriptors.visual_words import VisualWords
from sfm_front.types import Features

FLOAT32_NOISE = 1e-6

# The first two numbers of a descriptor are its place; words at (0, 0), (100, 0) and (0, 200).
PROJECTION = np.eye(128, 2)
WORDS = VisualWords(np.zeros(128), PROJECTION, np.array([[0, 0], [100, 0], [0, 200]]))


def features_at(*places: tuple[int, int]) -> Features:
    descriptors = np.zeros((len(places), 128), np.uint8)
    descriptors[:, :2] = np.reshape(places, (-1, 2))
    features = features_of(descriptors)
    features.keypoints[:, 2] = 1
    return features


def test_a_descriptor_points_from_its_nearest_word():
    directions = WORDS.directions(features_at((103, 4)))
    np.testing.assert_allclose(directions, [[0, 0], [0.6, 0.8], [0, 0]], atol=FLOAT32_NOISE)


def test_each_counts_the_same_however_far_from_its_word():
    directions = WORDS.directions(features_at((5, 0), (0, 40)))
    np.testing.assert_allclose(directions[0], [0.5**0.5, 0.5**0.5], atol=FLOAT32_NOISE)


def test_a_keypoint_counts_by_the_root_of_its_scale():
    features = features_at((5, 0), (0, 5))
    features.keypoints[:, 2] = 9, 16
    directions = WORDS.directions(features)
    np.testing.assert_allclose(directions[0], [0.6, 0.8], atol=FLOAT32_NOISE)


def test_without_descriptors_there_are_no_directions():
    assert not WORDS.directions(features_at()).any()


def test_the_mean_is_taken_off_before_projecting():
    mean = np.full(128, 10)
    words = VisualWords(mean, PROJECTION, np.zeros((1, 2)))
    descriptors = np.full((1, 128), 12, np.uint8)
    np.testing.assert_allclose(words.project(descriptors), [[2, 2]], atol=FLOAT32_NOISE)
