"""Write a small scene in every image format and read it back, for tests."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sfm_front.photos.reader import PhotoReader
from sfm_front.types import Photo, Skipped, Uint8Array

WIDTH, HEIGHT = 160, 120

FORMATS: dict[str, tuple[str, dict[str, Any]]] = {
    "jpeg": ("JPEG", {}),
    "progressive jpeg": ("JPEG", {"progressive": True}),
    "png": ("PNG", {}),
    "tiff": ("TIFF", {}),
    "tiff lzw": ("TIFF", {"compression": "tiff_lzw"}),
    "bmp": ("BMP", {}),
    "webp": ("WEBP", {}),
}


def scene(width: int = WIDTH, height: int = HEIGHT) -> Uint8Array:
    """(height, width, 3) uint8: smooth, coloured, and different in every corner."""
    x, y = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    red, green, blue = 255 * x, 255 * y, 127 + 120 * np.sin(9 * x + 5 * y)
    return np.stack([red, green, blue], axis=-1).astype(np.uint8)


def encoded(image: Image.Image, kind: str, **options: Any) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


def read(folder: Path, data: bytes, *, name: str = "a.jpg", **options: int) -> Photo | Skipped:
    path = folder / name
    path.write_bytes(data)
    return PhotoReader(**options).read(path, name)


def read_photo(folder: Path, data: bytes, **options: int) -> Photo:
    photo = read(folder, data, name="a.jpg", **options)
    assert isinstance(photo, Photo), photo
    assert photo.pixels.dtype == np.uint8
    assert photo.pixels.shape[2] == 3
    assert photo.pixels.flags.c_contiguous
    return photo


def difference(photo: Photo, expected: NDArray[Any]) -> Any:
    return np.abs(photo.pixels.astype(int) - expected.astype(int))
