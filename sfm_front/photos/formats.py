"""The image formats that can be read: which one a file has, and whether its end is missing."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from typing import IO, Literal

from PIL import (
    BmpImagePlugin,
    JpegImagePlugin,
    PngImagePlugin,
    TiffImagePlugin,
    WebPImagePlugin,
)
from PIL.ImageFile import ImageFile

EXTENSIONS = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp")
"""Extensions of photos, in lower case."""


@dataclass(frozen=True, slots=True)
class ImageFormat:
    """One format.

    ``signatures`` are the first bytes a file may have. ``open`` reads the header of a binary file;
    ``load`` on the result reads the pixels. It is the format's own reader instead of
    ``PIL.Image.open``, whose guard against decompression bombs refuses the 200-megapixel JPEGs of
    today's phones and is a global flag. ``is_cut_short``: whether the bytes of a file end before
    its image does; if it is always False, decoding finds out.
    """

    name: str
    signatures: tuple[bytes, ...]
    open: Callable[[IO[bytes]], ImageFile]
    is_cut_short: Callable[[bytes], bool]


def format_of(data: bytes) -> ImageFormat | None:
    """The format by a file's first bytes (12 are enough), whatever its name."""
    for known in FORMATS:
        if data.startswith(known.signatures):
            return known if known.name != "WebP" or data[8:12] == b"WEBP" else None
    return None


def _jpeg_is_cut_short(data: bytes) -> bool:
    """Whether no end-of-image marker follows the start of the scan.

    Decoders tend to fill the missing part with grey. The search begins at the scan because a
    thumbnail in the header has its own end marker, and does not expect the marker last because
    phones append further images and videos. Within a scan, data bytes 0xFF are escaped (ITU-T
    T.81, B.1.1.5).
    """
    at = 2
    while at + 4 <= len(data):
        if data[at] != 0xFF:
            return False  # No marker: damaged, which the decoder reports.
        marker = data[at + 1]
        if marker == 0xDA:
            return data.find(b"\xff\xd9", at) < 0
        if marker == 0xFF:  # A fill byte.
            at += 1
        elif marker == 0x01 or 0xD0 <= marker <= 0xD9:  # Markers without a length.
            at += 2
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return True


def _png_is_cut_short(data: bytes) -> bool:
    """Whether the chain of chunks (length, type, content, checksum) ends before ``IEND``."""
    at = 8
    while at + 8 <= len(data):
        if data[at + 4 : at + 8] == b"IEND":
            return False
        at += 12 + int.from_bytes(data[at : at + 4], "big")
    return True


def _webp_is_cut_short(data: bytes) -> bool:
    """Whether the file is shorter than its RIFF header states."""
    return len(data) < 8 + int.from_bytes(data[4:8], "little")


def _tiff_is_cut_short(data: bytes) -> bool:
    """Whether the first directory, or a strip or tile in it, ends beyond the file."""
    order: Literal["little", "big"] = "little" if data[:2] == b"II" else "big"
    is_big_tiff = int.from_bytes(data[2:4], order) == 43
    directory = int.from_bytes(data[8:16] if is_big_tiff else data[4:8], order)
    if len(data) < 16 or directory >= len(data):
        return True
    try:
        tags = _tiff_directory(data)
        for offsets, counts in ((273, 279), (324, 325)):  # Strips, tiles: offset, byte count.
            for offset, count in zip(tags.get(offsets, ()), tags.get(counts, ()), strict=False):
                if offset + count > len(data):
                    return True
    except struct.error:  # The directory itself is incomplete.
        return True
    except Exception:  # A damaged directory raises anything; decoding reports it.
        return False
    return False


def tiff_size(data: bytes) -> tuple[int, int]:
    """Width and height in a TIFF's first directory; raises ValueError if it has none."""
    tags = _tiff_directory(data)
    if 256 not in tags or 257 not in tags:
        raise ValueError("no image size")
    return int(tags[256]), int(tags[257])


def _tiff_directory(data: bytes) -> TiffImagePlugin.ImageFileDirectory_v2:
    header_bytes = 8 if 42 in data[2:4] else 16  # 43 is BigTIFF.
    tags = TiffImagePlugin.ImageFileDirectory_v2(data[:header_bytes])
    file = BytesIO(data)
    file.seek(tags.next)
    tags.load(file)
    return tags


def _unknown_until_decoded(_data: bytes) -> bool:
    return False


FORMATS = (
    ImageFormat("JPEG", (b"\xff\xd8\xff",), JpegImagePlugin.JpegImageFile, _jpeg_is_cut_short),
    ImageFormat("PNG", (b"\x89PNG\r\n\x1a\n",), PngImagePlugin.PngImageFile, _png_is_cut_short),
    ImageFormat(
        "TIFF",
        (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"),
        TiffImagePlugin.TiffImageFile,
        _tiff_is_cut_short,
    ),
    ImageFormat("BMP", (b"BM",), BmpImagePlugin.BmpImageFile, _unknown_until_decoded),
    ImageFormat("WebP", (b"RIFF",), WebPImagePlugin.WebPImageFile, _webp_is_cut_short),
)
