"""Describing with a memory: the same as without, nothing twice, boxes, damage, bad photos."""

from __future__ import annotations

from dataclasses import fields, replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from helpers import photo_files
from PIL import Image

from sfm_front.features import feature_cache as description_files
from sfm_front.features.cached_extraction import CachedExtraction, CachedPhoto, crop
from sfm_front.features.feature_cache import CachedFeatures, FeatureCache
from sfm_front.features.global_descriptors.descriptor import VLAD_WEIGHT, GlobalDescriptor
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.features.sift import SiftExtractor, SiftOptions
from sfm_front.photos.reader import PhotoReader
from sfm_front.types import Exif, GeoPosition, GimbalAngles, PhotoPath, Skipped, SkipReason

SUBPIXEL_PX = 0.6
VECTOR_TOLERANCE = 1e-6  # float32
SIFT = SiftOptions(max_features=300)


class MeanColor:
    """A network's stand-in that counts its calls."""

    name = "mean"
    dimension = 3

    def __init__(self, fingerprint: str = "mean") -> None:
        self.fingerprint = fingerprint
        self.calls = 0

    def describe(self, pixels: np.ndarray) -> np.ndarray:
        self.calls += 1
        mean = pixels.mean(axis=(0, 1)).astype(np.float32)
        return mean / np.linalg.norm(mean)


class CountingSift(SiftExtractor):
    calls = 0

    def extract(self, photo):
        self.calls += 1
        return super().extract(photo)


class Setup:
    def __init__(
        self,
        folder: Path,
        *,
        sift: SiftOptions = SIFT,
        size: int = 1600,
        fingerprint: str = "mean",
        vlad_weight: float = VLAD_WEIGHT,
    ) -> None:
        self.network = MeanColor(fingerprint)
        self.sift = CountingSift(sift)
        self.describer = CachedExtraction(
            folder / "cache",
            PhotoReader(max_image_size=size),
            self.sift,
            {
                "mean": GlobalDescriptor(networks=[self.network]),
                "vlad": GlobalDescriptor(local=[Vlad()]),
                "joined": GlobalDescriptor(
                    networks=[self.network], local=[Vlad()], vlad_weight=vlad_weight
                ),
            },
        )


@pytest.fixture
def photo(tmp_path) -> PhotoPath:
    return PhotoPath("1_0.png", photo_files.save(tmp_path, "1_0.png")[0])


def same(first: CachedPhoto, second: CachedPhoto) -> bool:
    features = zip(
        *((r.photo.features.keypoints, r.photo.features.descriptors) for r in (first, second)),
        strict=True,
    )
    return all(np.array_equal(a, b) for a, b in features) and all(
        np.array_equal(first.vectors[name], second.vectors[name]) for name in first.vectors
    )


def test_a_photo_is_described_as_by_its_parts(tmp_path, photo):
    setup = Setup(tmp_path)
    recalled = setup.describer.describe(photo)
    read = PhotoReader().read(photo.path, photo.name)
    features = SiftExtractor(SIFT).extract(read)
    np.testing.assert_array_equal(recalled.photo.features.keypoints, features.keypoints)
    vlad, mean = recalled.vectors["vlad"], recalled.vectors["mean"]
    np.testing.assert_allclose(vlad, Vlad().describe(features), atol=VECTOR_TOLERANCE)
    np.testing.assert_allclose(mean, MeanColor().describe(read.pixels), atol=VECTOR_TOLERANCE)
    np.testing.assert_array_equal(recalled.photo.global_vector, recalled.vectors["mean"])
    assert recalled.photo.digest == read.digest
    assert (recalled.photo.width, recalled.photo.height) == (320, 240)


def test_nothing_is_done_twice(tmp_path, photo):
    first = Setup(tmp_path).describer.describe(photo)
    later = Setup(tmp_path)
    assert same(first, later.describer.describe(photo))
    assert (later.network.calls, later.sift.calls) == (0, 0)


def test_the_bytes_count_and_not_the_name(tmp_path, photo):
    Setup(tmp_path).describer.describe(photo)
    later = Setup(tmp_path)
    copy = tmp_path / "copy.png"
    copy.write_bytes(photo.path.read_bytes())
    assert later.describer.describe(PhotoPath("copy.png", copy)).photo.name == "copy.png"
    assert later.sift.calls == 0
    photo_files.photo(2, 0).save(photo.path)
    later.describer.describe(photo)
    assert later.sift.calls == 1


CHANGED_SIFT = [
    replace(SIFT, max_features=200),
    replace(SIFT, described_per_kept=3),
    replace(SIFT, large_photo_px=50_000),
    replace(SIFT, contrast_threshold=0.03),
    replace(SIFT, small_photo_contrast_threshold=0.03),
]


@pytest.mark.parametrize("other", [{"size": 200}, *({"sift": sift} for sift in CHANGED_SIFT)])
def test_other_settings_have_other_features(tmp_path, photo, other):
    Setup(tmp_path).describer.describe(photo)
    later = Setup(tmp_path, **other)
    later.describer.describe(photo)
    assert (later.network.calls, later.sift.calls) == (2, 1)


def test_every_option_of_sift_is_among_those_settings():
    changed = {
        field.name
        for sift in CHANGED_SIFT
        for field in fields(SiftOptions)
        if getattr(sift, field.name) != getattr(SIFT, field.name)
    }
    assert changed == {field.name for field in fields(SiftOptions)}


def test_another_weight_has_another_joined_vector_and_the_same_parts(tmp_path, photo):
    first = Setup(tmp_path).describer.describe(photo)
    later = Setup(tmp_path, vlad_weight=0.5)
    second = later.describer.describe(photo)
    assert (later.network.calls, later.sift.calls) == (1, 0)
    for name in first.vectors:
        differs = not np.array_equal(first.vectors[name], second.vectors[name])
        assert differs == (name == "joined")


def test_another_network_leaves_features_as_they_are(tmp_path, photo):
    Setup(tmp_path).describer.describe(photo)
    later = Setup(tmp_path, fingerprint="trained longer")
    later.describer.describe(photo)
    assert (later.network.calls, later.sift.calls) == (2, 0)


def test_photos_described_by_other_code_are_described_again(tmp_path, photo, monkeypatch):
    Setup(tmp_path).describer.describe(photo)
    monkeypatch.setattr(description_files, "_code_digest", lambda: "changed")
    later = Setup(tmp_path)
    later.describer.describe(photo)
    assert (later.network.calls, later.sift.calls) == (2, 1)


@pytest.mark.parametrize("kind", ["features", "vectors"])
def test_damaged_files_are_made_again(tmp_path, photo, kind):
    first = Setup(tmp_path).describer.describe(photo)
    damaged = list((tmp_path / "cache" / kind).iterdir())
    assert damaged
    for path in damaged:
        path.write_bytes(path.read_bytes()[:200])
    assert same(first, Setup(tmp_path).describer.describe(photo))
    later = Setup(tmp_path)
    later.describer.describe(photo)
    assert (later.network.calls, later.sift.calls) == (0, 0)


def test_a_box_is_described_alone_and_in_pixels_of_the_file(tmp_path, photo):
    setup = Setup(tmp_path)
    whole = setup.describer.describe(photo)
    boxed = setup.describer.describe(photo, (100, 60, 260, 200))
    xy = boxed.photo.features.keypoints[:, :2]
    assert len(xy) > 20
    assert (xy.min(axis=0) >= (100, 60)).all()
    assert (xy.max(axis=0) <= (260, 200)).all()
    assert (boxed.photo.width, boxed.photo.height) == (320, 240)
    assert not np.allclose(boxed.vectors["mean"], whole.vectors["mean"])
    # Those that do not depend on its borders are at the same place in the whole photo.
    away = np.linalg.norm(xy[:, None] - whole.photo.features.keypoints[None, :, :2], axis=2)
    assert (away.min(axis=1) < SUBPIXEL_PX).mean() > 0.3
    assert same(boxed, Setup(tmp_path).describer.describe(photo, (100, 60, 260, 200)))


def test_a_box_holds_at_any_working_size_and_is_cut_at_the_border(photo):
    read = PhotoReader(max_image_size=160).read(photo.path, photo.name)
    part, offset = crop(read, (100, 60, 260, 200))
    assert part.pixels.shape == (70, 80, 3)
    assert (part.width, part.height, *offset) == (160, 140, 100, 60)
    part, offset = crop(read, (300, -50, 5000, 20))
    assert part.pixels.shape == (10, 10, 3)
    assert offset == (300, 0)
    part, _ = crop(read, (700, 700, 800, 800))
    assert part.pixels.shape == (1, 1, 3)


def test_photos_come_in_order_and_bad_ones_with_their_reason(tmp_path, photo):
    blank = tmp_path / "blank.png"
    Image.new("RGB", (100, 100)).save(blank)
    text = tmp_path / "text.jpg"
    text.write_text("no image")
    paths = [blank, photo.path, text, tmp_path / "missing.png"]
    photos = [PhotoPath(path.name, path) for path in paths]
    results = list(Setup(tmp_path).describer.stream(photos, num_threads=2))
    assert [type(result) for result in results] == [Skipped, CachedPhoto, Skipped, Skipped]
    assert results[0].reason is SkipReason.NO_FEATURES
    assert results[2].reason is SkipReason.NOT_AN_IMAGE
    assert results[3].reason is SkipReason.UNREADABLE


def test_what_a_camera_wrote_comes_back(tmp_path, photo):
    files = FeatureCache(tmp_path / "files")
    exif = Exif(
        make="Zeiß",
        model="Ikon",
        focal_length_mm=24.5,
        captured_at=datetime(2020, 2, 29, 12, 30, 1),
        position=GeoPosition(48.2, 16.4, None, 0.02),
        orientation=6,
        gimbal=GimbalAngles(12.5, -90.0, 0.0),
    )
    features = Setup(tmp_path).describer.describe(photo).photo.features
    files.save_local("a" * 32, CachedFeatures(320, 240, exif, features))
    assert files.load_local("a" * 32).exif == exif
    assert files.load_local("b" * 32) is None


def test_arrays_that_do_not_fit_each_other_count_as_damaged(tmp_path, photo):
    files = FeatureCache(tmp_path / "files")
    features = Setup(tmp_path).describer.describe(photo).photo.features
    odd = replace(features, descriptors=features.descriptors[:-1])
    files.save_local("a" * 32, CachedFeatures(320, 240, Exif(), odd))
    assert files.load_local("a" * 32) is None
