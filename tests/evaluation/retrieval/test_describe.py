"""Photos of a dataset described for the benchmark; perceptual hashes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers import photo_files
from PIL import Image, ImageEnhance

from sfm_front.errors import ConfigError
from sfm_front.evaluation.retrieval.describe import BenchExtraction
from sfm_front.evaluation.retrieval.perceptual_hash import PerceptualHash, packed
from sfm_front.evaluation.retrieval.types import Query
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.global_descriptors.vlad import Vlad


def describer(folder: Path) -> BenchExtraction:
    return BenchExtraction(
        folder / "cache", {"vlad": GlobalDescriptor(local=[Vlad()])}, max_features=200
    )


@pytest.fixture
def photos(tmp_path) -> dict[str, Path]:
    paths = photo_files.save(tmp_path / "photos", "1_0.png", "2_0.png")
    return {f"set/{path.stem}": path for path in paths}


def test_photos_have_ids_of_their_own_and_what_methods_ask_for(tmp_path, photos):
    seen = []
    described = describer(tmp_path).photos(photos, lambda *count: seen.append(count))
    assert list(described.photos) == ["set/1_0", "set/2_0"]
    assert [photo.view.image_id for photo in described.photos.values()] == [1, 2]
    assert seen == [(1, 2), (2, 2)]
    for photo in described.photos.values():
        assert set(photo.vectors) == {"vlad"}
        assert np.linalg.norm(photo.vectors["vlad"]) == pytest.approx(1, abs=1e-5)
        assert photo.perceptual_hash.shape == (8,)
        assert photo.perceptual_hash.dtype == np.uint8
        assert photo.view.camera.width == photo_files.WIDTH


def test_bad_photos_are_told(tmp_path, photos):
    bad = tmp_path / "bad.jpg"
    bad.write_text("")
    described = describer(tmp_path).photos({**photos, "set/bad": bad})
    assert [skipped.name for skipped in described.skipped] == ["set/bad"]
    assert list(described.photos) == ["set/1_0", "set/2_0"]


def test_queries_are_described_within_their_boxes_under_their_names(tmp_path, photos):
    bench = describer(tmp_path)
    whole = bench.photos(photos).photos["set/1_0"]
    box = (40.0, 30.0, 200.0, 200.0)
    queries = [
        Query("part", "set/1_0", frozenset(), box=box),
        Query("whole", "set/1_0", frozenset()),
    ]
    described = bench.queries(queries, photos).photos
    xy = described["part"].view.features.keypoints[:, :2]
    assert (xy >= box[:2]).all()
    assert (xy <= box[2:]).all()
    np.testing.assert_array_equal(described["whole"].vectors["vlad"], whole.vectors["vlad"])
    ids = {photo.view.image_id for photo in (*described.values(), whole)}
    assert len(ids) == 3


def test_the_hash_needs_no_asking_for(tmp_path):
    hashing = GlobalDescriptor(networks=[PerceptualHash()])
    with pytest.raises(ConfigError, match="every photo has a phash"):
        BenchExtraction(tmp_path, {"phash": hashing})


def different_bits(first: Image.Image, second: Image.Image) -> int:
    hashes = [packed(PerceptualHash().describe(np.asarray(image))) for image in (first, second)]
    return int(np.unpackbits(hashes[0] ^ hashes[1]).sum())


def test_a_perceptual_hash_survives_what_the_eye_hardly_sees(tmp_path):
    photo = photo_files.photo(1, 0)
    darker = ImageEnhance.Brightness(photo).enhance(0.7)
    photo.save(tmp_path / "a.jpg", quality=25)
    assert different_bits(photo, photo) == 0
    assert different_bits(photo, darker) <= 2
    assert different_bits(photo, photo.resize((161, 119))) <= 4
    assert different_bits(photo, Image.open(tmp_path / "a.jpg")) <= 4
    assert 16 < different_bits(photo, photo_files.photo(2, 0)) < 48


def test_a_perceptual_hash_is_the_sign_of_low_frequencies():
    """A wave of k half periods across the photo has one coefficient above the median."""
    x = (np.arange(256) + 0.5) / 256
    for k in (1, 3, 6):
        wave = 128 + 100 * np.cos(np.pi * k * x)
        pixels = np.repeat(np.tile(wave, (256, 1))[..., None], 3, axis=2).astype(np.uint8)
        bits = np.unpackbits(packed(PerceptualHash().describe(pixels))).reshape(8, 8)
        assert bits[0, k] == 1
        assert PerceptualHash().describe(255 - pixels).reshape(8, 8)[0, k] < 0


def test_cosine_and_hamming_distance_say_the_same():
    first, second = (
        PerceptualHash().describe(np.asarray(photo_files.photo(seed, 0))) for seed in (1, 2)
    )
    distance = np.unpackbits(packed(first) ^ packed(second)).sum()
    assert first @ second == pytest.approx(1 - 2 * distance / 64)
    assert np.linalg.norm(first) == pytest.approx(1)
