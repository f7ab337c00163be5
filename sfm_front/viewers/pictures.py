"""What pictures of photos share: thumbnails, text, writing the file."""

from __future__ import annotations

import unicodedata
from functools import lru_cache
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from sfm_front.errors import InputError
from sfm_front.photos.reader import PhotoReader
from sfm_front.storage.atomic import write_atomically
from sfm_front.types import Skipped

Color = tuple[int, int, int]
Font = ImageFont.FreeTypeFont | ImageFont.ImageFont

BACKGROUND: Color = (255, 255, 255)
INK: Color = (25, 28, 33)
FAINT: Color = (110, 116, 124)
RULE: Color = (222, 225, 229)
WRONG: Color = (214, 39, 40)
QUERY: Color = (31, 100, 190)

_SYSTEM_FONTS = ("DejaVuSans.ttf", "Arial.ttf", "arial.ttf", "LiberationSans-Regular.ttf")
_PICTURE_SUFFIXES = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG"}


def load(path: Path, max_size: int) -> Image.Image:
    """The photo at ``path``, as stored, its long side at most ``max_size`` pixels; if it cannot
    be read, a grey square with the reason."""
    photo = PhotoReader(max_image_size=max_size, min_image_size=1).read(path, path.name)
    if not isinstance(photo, Skipped):
        return Image.fromarray(photo.pixels)
    empty = Image.new("RGB", (max_size, max_size), (228, 228, 228))
    write(empty, str(photo), (8, 8), size=16, ink=FAINT, width=max_size - 16, anchor="la")
    return empty


def write(
    picture: Image.Image,
    text: str,
    at: tuple[int, int],
    *,
    size: int,
    ink: Color,
    width: int,
    anchor: str,
) -> None:
    """Write ``text`` with its ``anchor``, in Pillow's notation, at the point ``at``.

    If it is wider than ``width`` pixels, its middle is left out.
    """
    font = _font(text, size)
    if font is None:
        text = unicodedata.normalize("NFKD", text).encode("ascii", "replace").decode()
        font = ImageFont.load_default(size)
    ImageDraw.Draw(picture).text(at, shortened(text, width, font), ink, font, anchor)


def shortened(text: str, width: int, font: Font) -> str:
    """``text``, with as much of its middle left out as it takes to fit ``width`` pixels."""
    if font.getlength(text) <= width:
        return text
    for kept in range(len(text) - 1, 1, -1):
        short = f"{text[: kept // 3]}...{text[len(text) - (kept - kept // 3) :]}"
        if font.getlength(short) <= width:
            return short
    return "..."


@lru_cache
def _system_font(size: int) -> Font | None:
    for name in _SYSTEM_FONTS:
        try:
            return ImageFont.truetype(name, size)
        except OSError:  # Not on this machine.
            continue
    return None


def _font(text: str, size: int) -> Font | None:
    """Pillow's own font for ASCII text, else a system font; None if the system has none."""
    return ImageFont.load_default(size) if text.isascii() else _system_font(size)


def check_picture(path: Path) -> None:
    """Raises InputError if ``save`` cannot write this file type."""
    if path.suffix.lower() not in _PICTURE_SUFFIXES:
        raise InputError(f"{path}: pictures are written as {', '.join(_PICTURE_SUFFIXES)}")


def save(picture: Image.Image, path: Path) -> None:
    """Write a PNG or JPEG, by extension. Raises InputError if it cannot be written."""
    check_picture(path)
    kind = _PICTURE_SUFFIXES[path.suffix.lower()]
    options = {"quality": 92} if kind == "JPEG" else {}
    write_atomically(path, lambda file: picture.save(file, kind, **options))
