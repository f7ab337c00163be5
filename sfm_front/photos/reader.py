"""A photo's file → Photo, or the reason why it is skipped."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from sfm_front.errors import ConfigError
from sfm_front.photos.decoding import Undecodable, decode
from sfm_front.photos.time_limit import READ_TIMEOUT_S, read_within
from sfm_front.types import Photo, Skipped, SkipReason


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoReader:
    """Reads photos: JPEG, PNG, TIFF, BMP and WebP with any pixel type.

    ``max_image_size``: the long side of a photo's pixels is reduced to this, never enlarged.
    ``min_image_size``: files whose short side is below this are skipped. Both in pixels.
    ``timeout_s``: files that take longer to read, decoding apart, are skipped.
    Stateless and thread-safe.
    """

    max_image_size: int = 1600
    min_image_size: int = 64
    timeout_s: float = READ_TIMEOUT_S

    def __post_init__(self) -> None:
        if self.min_image_size < 1:
            raise ConfigError(f"min_image_size must be at least 1, got {self.min_image_size}")
        if self.max_image_size < self.min_image_size:
            raise ConfigError(
                f"max_image_size must be at least min_image_size ({self.min_image_size}), "
                f"got {self.max_image_size}"
            )
        if not self.timeout_s > 0:
            raise ConfigError(f"timeout_s must be above 0, got {self.timeout_s}")

    def read(self, path: Path, name: str) -> Photo | Skipped:
        """Read the photo at ``path`` under the name ``name``. Never raises, whatever the file."""
        data = _content(path, name, self.timeout_s)
        if isinstance(data, Skipped):
            return data
        decoded = decode(data, self.max_image_size)
        if isinstance(decoded, Undecodable):
            return Skipped(name, decoded.reason, decoded.detail)
        if min(decoded.width, decoded.height) < self.min_image_size:
            return Skipped(
                name,
                SkipReason.TOO_SMALL,
                f"{decoded.width} x {decoded.height} pixels, "
                f"the short side must have at least {self.min_image_size}",
            )
        return Photo(
            name=name,
            path=path,
            pixels=decoded.pixels,
            width=decoded.width,
            height=decoded.height,
            digest=_digest(data),
            exif=decoded.exif,
        )


def file_digest(path: Path, name: str) -> str | Skipped:
    """The ``digest`` of a ``Photo`` of this file, decodable or not. Never raises."""
    data = _content(path, name, READ_TIMEOUT_S)
    return data if isinstance(data, Skipped) else _digest(data)


def _content(path: Path, name: str, timeout_s: float) -> bytes | Skipped:
    try:
        return read_within(timeout_s, path, lambda file: file.read())
    except (OSError, ValueError, MemoryError) as error:
        detail = getattr(error, "strerror", None) or str(error) or type(error).__name__
        return Skipped(name, SkipReason.UNREADABLE, detail)


def _digest(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=16).hexdigest()
