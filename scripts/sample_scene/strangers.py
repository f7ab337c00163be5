"""Files among the sample's photos that find no place in its model, each for another reason."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

_SIZE = (1000, 750)
_BLUR_PX = 18
_SHELVES = 3
_INKS = ("#f4ead2", "#e2c16b", "#1d1a17", "#d9dde2")


def add_strangers(photos: Path) -> None:
    """Add a photo of something else, a blurred one, a copy, and half a file to a folder of photos
    of the sample."""
    files = sorted(photos.iterdir())
    bookshelf().save(photos / "bookshelf.jpg", quality=92)
    with Image.open(files[9]) as sharp:
        blurred = sharp.filter(ImageFilter.GaussianBlur(_BLUR_PX))
        blurred.save(photos / "blurred.jpg", quality=92)
    shutil.copyfile(files[11], photos / f"copy of {files[11].name}")
    whole = files[13].read_bytes()
    (photos / "torn.jpg").write_bytes(whole[: len(whole) // 2])


def bookshelf(seed: int = 3) -> Image.Image:
    """Books on shelves, with lettering: much to find, and nothing of it in a village."""
    rng = np.random.default_rng(seed)
    width, height = _SIZE
    image = Image.new("RGB", _SIZE, "#2a2019")
    draw = ImageDraw.Draw(image)
    shelf = height // _SHELVES
    for row in range(_SHELVES):
        bottom, left = (row + 1) * shelf - 16, 6
        while left < width - 20:
            thick = int(rng.integers(18, 52))
            _book(draw, rng, left, min(left + thick, width - 6), bottom, shelf)
            left += thick + int(rng.integers(0, 3))
        draw.rectangle((0, bottom, width, bottom + 16), fill="#8a6239")
        for line in rng.integers(bottom, bottom + 16, 5):
            draw.line((0, int(line), width, int(line)), fill="#74502c")
    grain = rng.normal(0, 3, (height, width, 1))
    pixels = np.asarray(image.filter(ImageFilter.GaussianBlur(0.7)), float) + grain
    return Image.fromarray(pixels.clip(0, 255).astype(np.uint8))


def _book(
    draw: ImageDraw.ImageDraw,
    rng: np.random.Generator,
    left: int,
    right: int,
    bottom: int,
    shelf: int,
) -> None:
    top = bottom - int(shelf * rng.uniform(0.62, 0.9))
    color = rng.integers(30, 190, 3)
    for x in range(left, right):  # Round, and lit from the left.
        light = 0.55 + 0.5 * np.sin(np.pi * (x - left + 1) / (right - left + 1))
        draw.line((x, top, x, bottom), fill=tuple((color * light).clip(0, 255).astype(int)))
    ink = _INKS[int(rng.integers(len(_INKS)))]
    for share in rng.uniform(0.05, 0.95, 3):
        y = top + int(share * (bottom - top))
        draw.rectangle((left, y, right, y + int(rng.integers(1, 5))), fill=ink)
    y = top + 14
    while y < bottom - 20:
        letter = int(rng.integers(3, 9))
        if rng.random() < 0.75:
            draw.rectangle((left + 6, y, right - int(rng.integers(6, 10)), y + letter), outline=ink)
        y += letter + 3
