"""VLAD against its definition."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.feature_making import features_of, random_descriptors, random_photos

from sfm_front.features.global_descriptors.codebook import Codebook
from sfm_front.features.global_descriptors.codebook_training import train_codebook
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.types import Features

FLOAT32_NOISE = 1e-5


@pytest.fixture(scope="module")
def codebook() -> Codebook:
    return train_codebook(random_photos(20, 100), num_words=8, dimension=16, seed=1)


def by_definition(codebook: Codebook, features: Features) -> np.ndarray:
    """VLAD written out one feature at a time."""
    mean, projection, words, whitening = (
        array.astype(np.float64)
        for array in (codebook.mean, codebook.projection, codebook.words, codebook.whitening)
    )
    sums = np.zeros_like(words)
    for keypoint, descriptor in zip(features.keypoints, features.descriptors, strict=True):
        point = (descriptor - mean) @ projection
        distances = np.linalg.norm(words - point, axis=1)
        residual = point - words[distances.argmin()]
        sums[distances.argmin()] += residual / np.linalg.norm(residual) * keypoint[2] ** 0.5
    rows = [
        matrix @ (row / (np.linalg.norm(row) or 1.0))
        for matrix, row in zip(whitening, sums, strict=True)
    ]
    return np.concatenate(rows) / np.linalg.norm(rows)


@pytest.mark.parametrize("count", [1, 3, 500])
def test_it_is_what_the_definition_says(codebook, count):
    features = features_of(random_descriptors(count, seed=count))
    vector = Vlad(codebook).describe(features)
    assert vector.dtype == np.float32
    assert vector.shape == (8 * 16,) == (Vlad(codebook).dimension,)
    np.testing.assert_allclose(vector, by_definition(codebook, features), atol=FLOAT32_NOISE)


def test_no_descriptors_give_zeros(codebook):
    vector = Vlad(codebook).describe(features_of(random_descriptors(0)))
    assert vector.shape == (8 * 16,)
    assert not vector.any()


def test_the_unit_of_scale_does_not_matter(codebook):
    features = features_of(random_descriptors(300))
    enlarged = Features(features.keypoints * 7, features.descriptors, features.colors)
    vlad = Vlad(codebook)
    np.testing.assert_allclose(vlad.describe(features), vlad.describe(enlarged), atol=FLOAT32_NOISE)


def test_photos_that_share_descriptors_are_closer_than_strangers():
    vlad = Vlad()
    shared, mine, yours, strange = (random_descriptors(400, seed) for seed in range(4))
    query, overlapping, stranger = (
        vlad.describe(features_of(descriptors))
        for descriptors in (
            np.concatenate([shared, mine]),
            np.concatenate([shared, yours]),
            np.concatenate([strange, yours]),
        )
    )
    assert query @ overlapping > query @ stranger + 0.1


def test_the_shipped_codebook_is_sound():
    vlad = Vlad()
    vector = vlad.describe(features_of(random_descriptors(100)))
    assert vector.shape == (vlad.dimension,)
    assert np.linalg.norm(vector) == pytest.approx(1.0, abs=FLOAT32_NOISE)
