"""SIFT: coordinates, scale, orientation and descriptors as COLMAP has them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from numpy.typing import NDArray
from PIL import Image

from sfm_front.errors import ConfigError
from sfm_front.features.sift import SiftExtractor, SiftOptions, root_sift
from sfm_front.photos.reader import PhotoReader
from sfm_front.types import Features, Photo

POSITION_TOLERANCE_PX = 0.1  # of the pixels that SIFT works on
COLMAP_OFFSET_PX = 0.05  # median, each axis, between two implementations of SIFT
COLMAP_SCALE_RATIO = 0.05
COLMAP_ANGLE_RAD = 0.12
COLMAP_COSINE = 0.95  # median, between the descriptors of one keypoint by both

# x, y in COLMAP's pixels: the top-left pixel's centre is (0.5, 0.5), its corner (0, 0).
BLOBS = np.array(
    [[60.0, 52.5], [140.25, 60.75], [220.6, 71.1], [71.4, 150.9], [150.5, 160.0], [230.9, 150.3]]
)


def blobs(width: int, height: int, centres: NDArray[np.float64], sigma: float) -> NDArray[np.uint8]:
    """(height, width, 3) uint8: bright Gaussian blobs on grey."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    light = sum(np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * sigma**2)) for cx, cy in centres)
    return np.repeat(np.rint(60 + 180 * light).astype(np.uint8)[..., None], 3, axis=2)


def texture(width: int = 320, height: int = 240, seed: int = 0) -> NDArray[np.uint8]:
    """(height, width, 3) uint8: smooth noise in three octaves and in colour."""
    rng = np.random.default_rng(seed)
    total = np.zeros((height, width, 3))
    for cells in (8, 20, 50):
        coarse = rng.integers(0, 256, (cells, cells, 3), dtype=np.uint8)
        octave = Image.fromarray(coarse).resize((width, height), Image.Resampling.BICUBIC)
        total += np.asarray(octave)
    return (total / 3).astype(np.uint8)


def photo_of(pixels: NDArray[np.uint8], enlarged: int = 1) -> Photo:
    """A photo whose file has ``enlarged`` times the pixels' width and height."""
    height, width = pixels.shape[:2]
    return Photo("a.png", Path("a.png"), pixels, width * enlarged, height * enlarged, "digest")


def nearest_px(features: Features, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P,) distance of each place to the nearest keypoint."""
    offsets = features.keypoints[None, :, :2] - places[:, None]
    return np.linalg.norm(offsets, axis=2).min(axis=1)


def test_keypoints_stand_on_the_blobs():
    features = SiftExtractor().extract(photo_of(blobs(300, 220, BLOBS, sigma=4.0)))
    assert nearest_px(features, BLOBS).max() < POSITION_TOLERANCE_PX


@pytest.mark.parametrize("factor", [2, 3])
def test_keypoints_of_a_reduced_photo_are_in_pixels_of_the_file(tmp_path, factor):
    centres = BLOBS * factor
    file = tmp_path / "a.png"
    Image.fromarray(blobs(300 * factor, 220 * factor, centres, sigma=4.0 * factor)).save(file)
    photo = PhotoReader(max_image_size=300).read(file, "a.png")
    assert isinstance(photo, Photo)
    assert photo.pixels.shape == (220, 300, 3)
    features = SiftExtractor().extract(photo)
    assert nearest_px(features, centres).max() < POSITION_TOLERANCE_PX * factor


def test_scale_is_in_pixels_of_the_file_too():
    pixels = texture()
    reduced = SiftExtractor().extract(photo_of(pixels, enlarged=2)).keypoints
    same_size = SiftExtractor().extract(photo_of(pixels)).keypoints
    np.testing.assert_allclose(reduced[:, :3], 2 * same_size[:, :3], rtol=1e-6)
    np.testing.assert_array_equal(reduced[:, 3], same_size[:, 3])


@pytest.fixture(scope="module")
def beside_colmap(tmp_path_factory) -> tuple[Features, NDArray[np.float32], NDArray[np.uint8]]:
    """The same photo by us and by COLMAP: our keypoints that COLMAP has, and COLMAP's for them."""
    pixels = texture(480, 360)
    file = tmp_path_factory.mktemp("sift") / "a.png"
    Image.fromarray(pixels).save(file)
    options = pycolmap.FeatureExtractionOptions()
    options.use_gpu = False
    options.num_threads = 1
    extractor = pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)
    keypoints, descriptors = extractor.extract(pycolmap.Bitmap.read(file, as_rgb=False))
    theirs = np.array([(k.x, k.y, k.compute_scale(), k.compute_orientation()) for k in keypoints])
    ours = SiftExtractor().extract(photo_of(pixels))
    apart = np.linalg.norm(ours.keypoints[:, None, :2] - theirs[None, :, :2], axis=2)
    turned = np.abs(np.angle(np.exp(1j * (ours.keypoints[:, None, 3] - theirs[None, :, 3]))))
    # Keypoints with two orientations stand twice in one place.
    cost = apart + turned
    partner = cost.argmin(axis=1)
    kept = apart[np.arange(len(partner)), partner] < 0.5
    assert kept.sum() > 200
    chosen = partner[kept]
    return (
        Features(ours.keypoints[kept], ours.descriptors[kept], ours.colors[kept]),
        theirs[chosen],
        np.asarray(descriptors.data)[chosen],
    )


def test_positions_agree_with_colmaps_own_sift(beside_colmap):
    ours, theirs, _ = beside_colmap
    offset = np.median(ours.keypoints[:, :2] - theirs[:, :2], axis=0)
    assert np.abs(offset).max() < COLMAP_OFFSET_PX


def test_scale_and_orientation_agree_with_colmaps_own_sift(beside_colmap):
    ours, theirs, _ = beside_colmap
    ratio = np.median(ours.keypoints[:, 2] / theirs[:, 2])
    assert ratio == pytest.approx(1, abs=COLMAP_SCALE_RATIO)
    turned = np.angle(np.exp(1j * (ours.keypoints[:, 3] - theirs[:, 3])))
    assert np.median(np.abs(turned)) < COLMAP_ANGLE_RAD


def test_descriptors_agree_with_colmaps_own_sift(beside_colmap):
    ours, _, theirs = beside_colmap
    cosine = np.einsum("nd,nd->n", ours.descriptors / 512.0, theirs / 512.0)
    assert np.median(cosine) > COLMAP_COSINE


def test_root_sift_by_hand():
    raw = np.zeros((2, 128), np.float32)
    raw[0, :4] = 1, 4, 9, 2  # the sum is 16
    raw[1, :3] = 100, 400, 8500  # the sum is 9000
    descriptors = root_sift(raw)
    assert descriptors.dtype == np.uint8
    # 512 sqrt(1/16) = 128 stays; 512 sqrt(4/16) = 256 and more is cut at 255.
    assert descriptors[0, :5].tolist() == [128, 255, 255, round(512 * np.sqrt(2 / 16)), 0]
    assert descriptors[1, :3].tolist() == [54, 108, 255]


def test_root_sift_is_colmaps_definition():
    raw = np.random.default_rng(0).gamma(0.4, 20.0, (300, 128)).astype(np.float32)
    # COLMAP: divide by the L1 norm, square root, round(512 x), cut at 255.
    by_definition = np.sqrt(raw.astype(np.float64) / raw.sum(axis=1, keepdims=True, dtype=float))
    expected = np.minimum(np.floor(512 * by_definition + 0.5), 255)
    different = root_sift(raw) != expected
    assert different.mean() < 1e-4  # where float32 rounds a tie the other way


def test_an_empty_descriptor_stays_empty():
    assert not root_sift(np.zeros((3, 128), np.float32)).any()


def test_the_largest_come_first_and_are_kept():
    photo = photo_of(texture())
    every = SiftExtractor(SiftOptions(max_features=100_000)).extract(photo)
    count = len(every) // 3
    few = SiftExtractor(SiftOptions(max_features=count)).extract(photo)
    places = np.unique(few.keypoints[:, :3], axis=0)
    # A place with two orientations counts once, and keeps both.
    assert len(places) == count < len(few)
    np.testing.assert_array_equal(few.keypoints[:, :3], every.keypoints[: len(few), :3])
    assert (np.diff(few.keypoints[:, 2]) <= 0).all()
    assert few.keypoints[-1, 2] >= every.keypoints[len(few) :, 2].max()


def test_colours_are_those_under_the_keypoints():
    pixels = texture()
    features = SiftExtractor().extract(photo_of(pixels, enlarged=2))
    at = np.floor(features.keypoints[:, :2] / 2).astype(int)
    np.testing.assert_array_equal(features.colors, pixels[at[:, 1], at[:, 0]])


def test_types_and_shapes():
    features = SiftExtractor(SiftOptions(max_features=80)).extract(photo_of(texture()))
    count = len(features)
    assert len(np.unique(features.keypoints[:, :3], axis=0)) == 80
    assert features.keypoints.shape == (count, 4)
    assert features.keypoints.dtype == np.float32
    assert features.descriptors.shape == (count, 128)
    assert features.descriptors.dtype == np.uint8
    assert features.colors.shape == (count, 3)
    assert features.colors.dtype == np.uint8
    assert (features.keypoints[:, 2] > 0).all()


def test_a_flat_photo_has_none():
    features = SiftExtractor().extract(photo_of(np.full((100, 120, 3), 90, np.uint8)))
    assert features.keypoints.shape == (0, 4)
    assert features.descriptors.shape == (0, 128)
    assert features.colors.shape == (0, 3)


def test_threads_may_share_an_extractor():
    sift = SiftExtractor(SiftOptions(max_features=200))
    photos = [photo_of(texture(seed=seed)) for seed in range(4)]
    alone = [sift.extract(photo) for photo in photos]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(sift.extract, photos))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.keypoints, other.keypoints)
        np.testing.assert_array_equal(one.descriptors, other.descriptors)


def test_more_are_described_to_keep_larger_ones():
    photo = photo_of(texture())
    by_response, by_scale = (
        SiftExtractor(SiftOptions(max_features=50, described_per_kept=count)).extract(photo)
        for count in (1, 4)
    )
    assert len(by_response) < 100
    assert by_scale.keypoints[:, 2].mean() > 1.1 * by_response.keypoints[:, 2].mean()


def test_the_size_of_a_photo_decides_on_its_contrast_threshold():
    photo = photo_of(texture())
    pixels = photo.pixels.shape[0] * photo.pixels.shape[1]

    def count(**options: float) -> int:
        return len(SiftExtractor(SiftOptions(**options)).extract(photo))

    small, large = {"large_photo_px": pixels + 1}, {"large_photo_px": pixels}
    assert count(**small) > count(**large) > 0
    assert count(**small, small_photo_contrast_threshold=0.04) == count(**large)
    assert count(**large, contrast_threshold=0.02) == count(**small)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"max_features": 0}, "max_features must be at least 1, got 0"),
        ({"described_per_kept": 0}, "described_per_kept must be at least 1, got 0"),
        ({"large_photo_px": -1}, "large_photo_px must not be negative, got -1"),
        ({"contrast_threshold": 0.0}, "contrast_threshold must be above 0 and below 1, got 0.0"),
        ({"small_photo_contrast_threshold": 1.0}, "small_photo_contrast_threshold must be above"),
    ],
)
def test_values_out_of_range_are_refused_by_name(wrong, message):
    with pytest.raises(ConfigError, match=f"^{message}"):
        SiftOptions(**wrong)
