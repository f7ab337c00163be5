"""COLMAP's SIFT behind our interface, here on the CPU."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sfm_front.features.colmap_sift import ColmapSift
from sfm_front.features.sift import SiftExtractor, SiftOptions
from sfm_front.matching.nearest_neighbors import MatchingOptions, match_descriptors
from sfm_front.types import Features, Photo

OFFSET_PX = 0.1


def photo_of(pixels: np.ndarray, enlarged: int = 1) -> Photo:
    height, width = pixels.shape[:2]
    return Photo("a.png", Path("a.png"), pixels, width * enlarged, height * enlarged, "digest")


@pytest.fixture(scope="module")
def texture() -> np.ndarray:
    rng = np.random.default_rng(0)
    total = np.zeros((300, 400, 3))
    for cells in (8, 20, 50):
        coarse = rng.integers(0, 256, (cells, cells, 3), dtype=np.uint8)
        total += np.asarray(Image.fromarray(coarse).resize((400, 300), Image.Resampling.BICUBIC))
    return (total / 3).astype(np.uint8)


@pytest.fixture(scope="module")
def features(texture) -> Features:
    return ColmapSift(on_gpu=False).extract(photo_of(texture))


def test_its_keypoints_stand_where_opencvs_do(features, texture):
    ours = SiftExtractor().extract(photo_of(texture))
    matches = match_descriptors(features.descriptors, ours.descriptors, MatchingOptions())
    assert len(matches) > 150
    offsets = features.keypoints[matches[:, 0], :2] - ours.keypoints[matches[:, 1], :2]
    assert np.abs(np.median(offsets, axis=0)).max() < OFFSET_PX


def test_arrays_are_as_promised_the_largest_first(features):
    assert features.keypoints.dtype == np.float32
    assert features.keypoints.shape == (len(features), 4)
    assert features.descriptors.dtype == np.uint8
    assert features.descriptors.shape == (len(features), 128)
    assert features.colors.shape == (len(features), 3)
    assert (np.diff(features.keypoints[:, 2]) <= 0).all()
    np.testing.assert_allclose(np.linalg.norm(features.descriptors, axis=1), 512, rtol=0.03)


def test_keypoints_of_a_reduced_photo_are_in_pixels_of_the_file(features, texture):
    enlarged = ColmapSift(on_gpu=False).extract(photo_of(texture, enlarged=2))
    expected = features.keypoints * (2, 2, 2, 1)
    np.testing.assert_allclose(enlarged.keypoints, expected, rtol=1e-5)


def test_a_cap_leaves_the_largest_and_blank_photos_have_none(features, texture):
    few = ColmapSift(SiftOptions(max_features=50), on_gpu=False).extract(photo_of(texture))
    assert 50 <= len(few) < len(features) / 2
    np.testing.assert_array_equal(few.keypoints[:50], features.keypoints[:50])
    blank = np.full((80, 100, 3), 128, np.uint8)
    assert len(ColmapSift(on_gpu=False).extract(photo_of(blank))) == 0


def test_its_fingerprint_tells_what_changes_its_features():
    default = ColmapSift(on_gpu=False).fingerprint
    assert ColmapSift(SiftOptions(max_features=50), on_gpu=False).fingerprint != default
    assert ColmapSift(SiftOptions(contrast_threshold=0.1), on_gpu=False).fingerprint == default
    assert SiftExtractor().fingerprint != default
