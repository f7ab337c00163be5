"""Bytes of an image file → (h, w, 3) uint8 RGB pixels, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.ImageFile import ImageFile

from sfm_front.photos.exif import exif_of
from sfm_front.photos.formats import ImageFormat, format_of, tiff_size
from sfm_front.types import Exif, SkipReason, Uint8Array

MAX_PIXELS = 2**28
"""Larger images are refused: their RGB pixels alone take more than 0.8 GB of memory."""

_FULL_RANGES = tuple(2**bits - 1 for bits in (8, 10, 12, 14, 16, 32))


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """``pixels`` (h, w, 3) uint8 RGB at the working size; ``width``, ``height`` are the file's."""

    pixels: Uint8Array
    width: int
    height: int
    exif: Exif


@dataclass(frozen=True, slots=True)
class Undecodable:
    """Why bytes give no image."""

    reason: SkipReason
    detail: str


def decode(data: bytes, max_image_size: int) -> Decoded | Undecodable:
    """Decode an image and reduce its long side to ``max_image_size`` pixels; never enlarge it.

    Pixels stay as stored: EXIF orientation is not applied, as in COLMAP. Transparent images are
    put on black. Never raises, whatever the bytes.
    """
    if not data:
        return Undecodable(SkipReason.EMPTY_FILE, "")
    image_format = format_of(data)
    if image_format is None:
        return Undecodable(
            SkipReason.NOT_AN_IMAGE, "the content is not JPEG, PNG, TIFF, BMP or WebP"
        )
    if image_format.is_cut_short(data):
        return Undecodable(SkipReason.TRUNCATED, f"the {image_format.name} data ends too soon")
    try:
        return _decode(data, image_format, max_image_size)
    except Exception as error:  # Decoders raise anything on hostile bytes.
        if "truncated" in str(error).lower():
            return Undecodable(SkipReason.TRUNCATED, f"the {image_format.name} data ends too soon")
        return Undecodable(SkipReason.UNREADABLE, f"damaged {image_format.name}: {error}")


def _decode(data: bytes, image_format: ImageFormat, max_image_size: int) -> Decoded | Undecodable:
    try:
        image: ImageFile | None = image_format.open(BytesIO(data))
    except SyntaxError:
        if image_format.name != "TIFF":
            raise
        image = None  # Pillow has no float or 32-bit integer colour images; OpenCV has.
    width, height = image.size if image is not None else tiff_size(data)
    if width * height > MAX_PIXELS:
        return Undecodable(SkipReason.UNREADABLE, f"{width} x {height} pixels are too many")
    exif = Exif() if image is None else exif_of(image)  # First: loading pixels closes a TIFF.
    if image is None:
        pixels = _to_8_bit_rgb(_decode_with_opencv(data))
    elif _is_deep(image, data):
        pixels = _load_deep(image, data)
    else:
        if image_format.name == "JPEG":
            _decode_reduced(image, max_image_size)
        pixels = _load_rgb(image)
    return Decoded(_shrink(pixels, width, height, max_image_size), width, height, exif)


def _decode_reduced(image: ImageFile, max_image_size: int) -> None:
    """Let the JPEG decoder reduce by a power of two, which is faster than decoding in full.

    Only if it divides both sides: the decoder rounds sizes up, and the padding in the last row or
    column would shift all coordinates by a fraction of a pixel.
    """
    width, height = image.size
    for factor in (8, 4, 2):
        if (
            max(width, height) // factor >= max_image_size
            and width % factor == 0
            and height % factor == 0
        ):
            image.draft(None, (width // factor, height // factor))
            return


def _load_rgb(image: ImageFile) -> Uint8Array:
    """Pixels of an image with at most 8 bits per channel: grey, palette, CMYK, alpha and so on."""
    image.load()
    if image.mode == "RGB" and not image.has_transparency_data:
        return np.array(image)
    if not image.has_transparency_data:
        return np.array(image.convert("RGB"))
    visible = image.convert("RGBA")
    on_black = Image.new("RGB", image.size)
    on_black.paste(visible, mask=visible.getchannel("A"))
    return np.array(on_black)


def _is_deep(image: ImageFile, data: bytes) -> bool:
    """Whether a channel has more than 8 bits; Pillow keeps only the upper 8 of colour images."""
    if image.mode.startswith(("I", "F")):
        return True
    if image.format == "PNG":
        return data[24] > 8  # The bit depth in the header chunk.
    if image.format == "TIFF":
        bits_per_channel: tuple[int, ...] = getattr(image, "tag_v2", {}).get(258, (1,))
        return max(bits_per_channel) > 8
    return False


def _load_deep(image: ImageFile, data: bytes) -> Uint8Array:
    image.load()  # Notices truncated data, which OpenCV may not.
    if image.mode.startswith(("I", "F")):
        return _to_8_bit_rgb(np.asarray(image))
    return _to_8_bit_rgb(_decode_with_opencv(data))


def _decode_with_opencv(data: bytes) -> NDArray[np.generic]:
    """(h, w) grey, or (h, w, 3 or 4) RGB or RGBA, in the file's own data type."""
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("no decoder for these pixels")
    if pixels.ndim == 3 and pixels.shape[2] >= 3:
        pixels[..., :3] = pixels[..., 2::-1].copy()
    return pixels


def _to_8_bit_rgb(deep: NDArray[np.generic]) -> Uint8Array:
    """(h, w) or (h, w, c) with more than 8 bits per channel → (h, w, 3) uint8.

    White is the smallest of the usual ranges, 8, 10, 12, 14, 16 and 32 bits, that holds the
    brightest value: many cameras use only some of 16 bits. For floats it is 1, or the brightest
    value if above.
    """
    values = np.nan_to_num(deep.astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    if values.ndim == 2:
        values = values[..., None]
    if np.issubdtype(deep.dtype, np.floating):
        full_range = max(float(values.max()), 1.0)
    else:
        full_range = next(r for r in _FULL_RANGES if r >= int(deep.max()))
    values = np.clip(values / full_range, 0.0, 1.0)
    colors, alpha = values[..., :3], values[..., 3:]
    if alpha.shape[2]:
        colors = colors * alpha
    return np.repeat(
        np.round(colors * 255).astype(np.uint8), 3 if colors.shape[2] == 1 else 1, axis=2
    )


def _shrink(pixels: Uint8Array, width: int, height: int, max_image_size: int) -> Uint8Array:
    """``pixels`` reduced to the working size of a file of ``width`` x ``height`` pixels."""
    scale = min(1.0, max_image_size / max(width, height))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    if (pixels.shape[1], pixels.shape[0]) == size:
        return pixels
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
