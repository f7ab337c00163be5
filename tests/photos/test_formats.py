"""Formats: which one a file's content is, and whether it ends too soon."""

from __future__ import annotations

from pathlib import Path

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

from sfm_front.types import Photo, Skipped, SkipReason


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", SkipReason.EMPTY_FILE),
        (b"hello, I am a text\n" * 50, SkipReason.NOT_AN_IMAGE),
        (b"RIFF\x24\0\0\0WAVEfmt " + bytes(50), SkipReason.NOT_AN_IMAGE),
        (encoded(Image.new("RGB", (90, 90)), "GIF"), SkipReason.NOT_AN_IMAGE),
        (bytes(1000), SkipReason.NOT_AN_IMAGE),
    ],
)
def test_content_decides_what_is_an_image(tmp_path: Path, data: bytes, reason: SkipReason) -> None:
    skipped = read(tmp_path, data)
    assert isinstance(skipped, Skipped)
    assert skipped.reason is reason
    assert skipped.name == "a.jpg"


def test_extension_does_not_matter(tmp_path: Path) -> None:
    data = encoded(Image.fromarray(scene()), "PNG")
    photo = read(tmp_path, data, name="really a png.JPG")
    assert isinstance(photo, Photo)
    assert difference(photo, scene()).max() == 0


@pytest.mark.parametrize("part", [0.02, 0.5, 0.97])
@pytest.mark.parametrize("name", list(FORMATS))
def test_cut_off_files_are_truncated(tmp_path: Path, name: str, part: float) -> None:
    kind, options = FORMATS[name]
    data = encoded(Image.fromarray(scene()), kind, **options)
    skipped = read(tmp_path, data[: int(len(data) * part)])
    assert isinstance(skipped, Skipped)
    assert skipped.reason is SkipReason.TRUNCATED


def test_16_bit_png_cut_off_is_truncated(tmp_path: Path) -> None:
    _, data = cv2.imencode(".png", scene().astype(np.uint16) * 257)
    skipped = read(tmp_path, data.tobytes()[: len(data) // 2])
    assert isinstance(skipped, Skipped)
    assert skipped.reason is SkipReason.TRUNCATED


def jpeg_with_thumbnail() -> bytes:
    """A JPEG whose header holds another whole JPEG, as cameras write them. Of its noise a decoder
    makes do with half the bytes when the others are zero, and says nothing."""
    thumbnail = encoded(Image.fromarray(scene(40, 30)), "JPEG")
    noise = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    data = encoded(Image.fromarray(noise), "JPEG", quality=95)
    segment = b"Exif\0\0" + thumbnail
    return data[:2] + b"\xff\xe1" + (len(segment) + 2).to_bytes(2, "big") + segment + data[2:]


def test_a_whole_thumbnail_does_not_hide_a_cut_off_jpeg(tmp_path: Path) -> None:
    data = jpeg_with_thumbnail()
    read_photo(tmp_path, data)
    half = len(data) // 2
    for lost in (data[:half], data[:half] + bytes(half)):
        skipped = read(tmp_path, lost)
        assert isinstance(skipped, Skipped)
        assert skipped.reason is SkipReason.TRUNCATED


def test_what_phones_append_to_a_jpeg_is_no_harm(tmp_path: Path) -> None:
    data = encoded(Image.fromarray(scene()), "JPEG")
    second = encoded(Image.fromarray(scene(80, 60)), "JPEG")
    for appended in (b"\0\0\0\x18ftypmp42" + bytes(5000), second, second[: len(second) // 2]):
        assert read_photo(tmp_path, data + appended).width == WIDTH
