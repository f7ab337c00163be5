"""Decoding: every kind of pixels, shrinking, and damage that never raises."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.image_making import (
    FORMATS,
    HEIGHT,
    WIDTH,
    difference,
    encoded,
    read,
    read_photo,
    scene,
)
from PIL import Image

from sfm_front.types import Photo, Skipped, SkipReason, Uint8Array

LOSSY_TOLERANCE = 6.0  # Mean absolute difference, grey levels, after JPEG or WebP.
ROUNDING_TOLERANCE = 1  # Grey levels.
SHIFT_TOLERANCE_PX = 0.3  # Of the file, where a pixel at the working size is eight.


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("PNG", {}),
        ("TIFF", {}),
        ("TIFF", {"compression": "tiff_lzw"}),
        ("TIFF", {"compression": "tiff_adobe_deflate"}),
        ("BMP", {}),
        ("WEBP", {"lossless": True}),
    ],
)
def test_lossless_formats_are_exact(tmp_path: Path, kind: str, options: dict[str, Any]) -> None:
    photo = read_photo(tmp_path, encoded(Image.fromarray(scene()), kind, **options))
    assert (photo.width, photo.height) == (WIDTH, HEIGHT)
    assert difference(photo, scene()).max() == 0


@pytest.mark.parametrize(
    ("kind", "options"), [("JPEG", {}), ("JPEG", {"progressive": True}), ("WEBP", {"quality": 95})]
)
def test_lossy_formats_keep_channel_order(
    tmp_path: Path, kind: str, options: dict[str, Any]
) -> None:
    photo = read_photo(tmp_path, encoded(Image.fromarray(scene()), kind, **options))
    assert difference(photo, scene()).mean() < LOSSY_TOLERANCE


def grey_scene() -> Uint8Array:
    return np.repeat(scene()[..., :1], 3, axis=2)


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF", "BMP"])
def test_grey_becomes_three_equal_channels(tmp_path: Path, kind: str) -> None:
    photo = read_photo(tmp_path, encoded(Image.fromarray(scene()[..., 0]), kind))
    assert difference(photo, grey_scene()).mean() < LOSSY_TOLERANCE
    assert np.ptp(photo.pixels, axis=2).max() == 0


@pytest.mark.parametrize("kind", ["JPEG", "TIFF"])
def test_cmyk_is_converted_not_inverted(tmp_path: Path, kind: str) -> None:
    """Pillow writes CMYK JPEG inverted, as Adobe does, and says so in the file."""
    photo = read_photo(tmp_path, encoded(Image.fromarray(scene()).convert("CMYK"), kind))
    assert difference(photo, scene()).mean() < LOSSY_TOLERANCE


def test_palette_and_one_bit_are_expanded(tmp_path: Path) -> None:
    palette = Image.fromarray(scene()).quantize(256)
    photo = read_photo(tmp_path, encoded(palette, "PNG"))
    assert difference(photo, np.asarray(palette.convert("RGB"))).max() == 0
    bits = scene()[..., 0] > 127
    photo = read_photo(tmp_path, encoded(Image.fromarray(bits), "PNG"))
    assert np.array_equal(photo.pixels, np.repeat(bits[..., None] * np.uint8(255), 3, axis=2))


@pytest.mark.parametrize("kind", ["PNG", "TIFF", "WEBP"])
def test_transparent_parts_are_put_on_black(tmp_path: Path, kind: str) -> None:
    alpha = np.full((HEIGHT, WIDTH), 255, np.uint8)
    alpha[:, :40] = 0
    alpha[:, 40:80] = 128
    image = Image.fromarray(np.dstack([scene(), alpha]))
    options = {"lossless": True, "exact": True} if kind == "WEBP" else {}
    photo = read_photo(tmp_path, encoded(image, kind, **options))
    expected = np.round(scene() * (alpha[..., None] / 255.0)).astype(np.uint8)
    assert difference(photo, expected).max() <= ROUNDING_TOLERANCE


def test_transparent_palette_colour_is_black(tmp_path: Path) -> None:
    image = Image.new("P", (WIDTH, HEIGHT), 1)
    image.putpalette([255, 255, 255, 10, 200, 30])
    image.paste(0, (0, 0, 80, HEIGHT))
    photo = read_photo(tmp_path, encoded(image, "PNG", transparency=0))
    assert photo.pixels[5, 5].tolist() == [0, 0, 0]
    assert photo.pixels[5, 100].tolist() == [10, 200, 30]


@pytest.mark.parametrize("extension", [".png", ".tif"])
@pytest.mark.parametrize(("bits", "factor"), [(16, 257), (12, 16)])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_16_bit_is_scaled_by_the_bits_that_are_used(
    tmp_path: Path, extension: str, bits: int, factor: int, channels: int
) -> None:
    full = 2**bits - 1
    pixels = scene().astype(np.uint16) * factor
    pixels[0, 0] = full  # The brightest value shows the range.
    bgr = pixels[..., ::-1].copy()
    if channels == 1:
        stored, expected = pixels[..., 0], np.repeat(pixels[..., :1], 3, axis=2)
    elif channels == 3:
        stored, expected = bgr, pixels
    else:
        alpha = np.full((HEIGHT, WIDTH, 1), full, np.uint16)
        alpha[:, 80:] = full // 2
        stored, expected = np.dstack([bgr, alpha]), pixels * (alpha / full)
    ok, data = cv2.imencode(extension, stored)
    assert ok
    photo = read_photo(tmp_path, data.tobytes())
    assert difference(photo, np.round(expected / full * 255)).max() <= ROUNDING_TOLERANCE


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("brightest", [1.0, 4.0])
def test_float_tiff_ends_at_one_or_at_its_brightest(
    tmp_path: Path, channels: int, brightest: float
) -> None:
    pixels = scene().astype(np.float32) / 255 * brightest
    pixels[0, 0] = brightest
    pixels[-1, 0] = np.nan
    expected = np.nan_to_num(np.round(pixels / brightest * 255))
    if channels == 1:
        stored, expected = pixels[..., 0], np.repeat(expected[..., :1], 3, axis=2)
    else:
        stored = pixels[..., ::-1].copy()
    ok, data = cv2.imencode(".tif", stored)
    assert ok
    photo = read_photo(tmp_path, data.tobytes())
    assert difference(photo, expected).max() <= ROUNDING_TOLERANCE


def test_orientation_is_reported_and_not_applied(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    photo = read_photo(tmp_path, encoded(Image.fromarray(scene()), "JPEG", exif=exif))
    assert photo.exif.orientation == 6
    assert (photo.width, photo.height) == (WIDTH, HEIGHT)
    assert difference(photo, scene()).mean() < LOSSY_TOLERANCE


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
@pytest.mark.parametrize(
    ("size", "shrunk"),
    [
        ((160, 120), (160, 120)),  # Never enlarged.
        ((640, 480), (200, 150)),  # Where JPEG is decoded at half its size first.
        ((641, 479), (200, 149)),  # Where it cannot be.
        ((300, 1700), (35, 200)),
    ],
)
def test_long_side_is_reduced(
    tmp_path: Path, kind: str, size: tuple[int, int], shrunk: tuple[int, int]
) -> None:
    data = encoded(Image.fromarray(scene(*size)), kind)
    photo = read_photo(tmp_path, data, max_image_size=200)
    assert (photo.width, photo.height) == size
    assert photo.pixels.shape == (shrunk[1], shrunk[0], 3)
    expected = cv2.resize(scene(*size), shrunk, interpolation=cv2.INTER_AREA)
    assert difference(photo, expected).mean() < LOSSY_TOLERANCE


@pytest.mark.parametrize("size", [(1600, 1200), (1607, 1207), (801, 1600)])
def test_shrinking_moves_nothing(tmp_path: Path, size: tuple[int, int]) -> None:
    """A blob near the far corner stays where width and height of file and pixels say, whether or
    not the JPEG decoder shrinks too (it would pad the odd sizes by up to 7 of 8 columns)."""
    x, y = np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5
    at_x, at_y = size[0] - 60.0, size[1] - 60.0
    blob = np.exp(-((x - at_x) ** 2 + (y[:, None] - at_y) ** 2) / (2 * 15.0**2))
    data = encoded(Image.fromarray((255 * blob).astype(np.uint8)), "JPEG", quality=100)
    photo = read_photo(tmp_path, data, max_image_size=200)
    grey = photo.pixels[..., 0].astype(float)
    grey[grey < 20] = 0
    height, width = grey.shape
    found_x = (grey.sum(axis=0) * (np.arange(width) + 0.5)).sum() / grey.sum() * size[0] / width
    found_y = (grey.sum(axis=1) * (np.arange(height) + 0.5)).sum() / grey.sum() * size[1] / height
    assert (found_x, found_y) == pytest.approx((at_x, at_y), abs=SHIFT_TOLERANCE_PX)


def test_multi_picture_jpeg_gives_its_first_picture(tmp_path: Path) -> None:
    other = Image.fromarray(scene(80, 60))
    data = encoded(Image.fromarray(scene()), "MPO", save_all=True, append_images=[other])
    photo = read_photo(tmp_path, data)
    assert (photo.width, photo.height) == (WIDTH, HEIGHT)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", list(FORMATS))
def test_damaged_bytes_never_raise(tmp_path: Path, name: str) -> None:
    """Random bytes written over valid files: a photo or a reason, nothing else."""
    kind, options = FORMATS[name]
    data = encoded(Image.fromarray(scene()), kind, **options)
    rng = np.random.default_rng(0)
    for _ in range(40):
        broken = bytearray(data)
        start = int(rng.integers(0, min(len(data), 600)))
        broken[start : start + 8] = rng.bytes(8)
        assert isinstance(read(tmp_path, bytes(broken)), Photo | Skipped)


def png_of_size(width: int, height: int) -> bytes:
    """A PNG that claims a size without having the pixels."""
    data = bytearray(encoded(Image.new("RGB", (100, 100)), "PNG"))
    data[16:24] = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    data[29:33] = zlib.crc32(bytes(data[12:29])).to_bytes(4, "big")
    return bytes(data)


@pytest.mark.filterwarnings("error")
def test_a_decompression_bomb_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    skipped = read(tmp_path, png_of_size(60_000, 60_000))
    assert isinstance(skipped, Skipped)
    assert skipped.reason is SkipReason.UNREADABLE
    assert "60000 x 60000" in skipped.detail


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["jpeg", "png", "bmp"])
def test_pillows_own_guard_does_not_refuse_large_photos(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """It raises from 179 megapixels; there are phones with 200."""
    kind, options = FORMATS[name]
    data = encoded(Image.fromarray(scene()), kind, **options)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", WIDTH * HEIGHT // 3)
    assert read_photo(tmp_path, data).width == WIDTH
