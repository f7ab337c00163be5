"""EXIF tags and XMP, however broken → Exif."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, BinaryIO

from PIL.Image import Image

from sfm_front.photos.formats import format_of
from sfm_front.photos.time_limit import READ_TIMEOUT_S, read_within
from sfm_front.photos.xmp import Xmp, read_xmp
from sfm_front.types import Exif, GeoPosition

FULL_FRAME_DIAGONAL_MM = 43.27
"""Diagonal of 35 mm film, the reference for 35 mm equivalent focal lengths (CIPA DCG-001)."""

_EXIF_IFD, _GPS_IFD = 0x8769, 0x8825
_MM_PER_RESOLUTION_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
_PLAUSIBLE_SENSOR_DIAGONAL_MM = (1.0, 100.0)


def read_exif(path: Path) -> Exif:
    """EXIF of a file, without decoding its pixels; an empty Exif if it cannot be read."""
    try:
        return read_within(READ_TIMEOUT_S, path, _exif_of_file)
    except Exception:  # Broken headers raise anything; PhotoReader will give the reason.
        return Exif()


def _exif_of_file(file: BinaryIO) -> Exif:
    image_format = format_of(file.read(16))
    if image_format is None:
        return Exif()
    file.seek(0)
    return exif_of(image_format.open(file))


def exif_of(image: Image) -> Exif:
    """EXIF of an opened image. Never raises: missing, NaN, infinite and out-of-range values are
    left out.

    ``focal_length_35mm`` is the camera's own value or, without one, derived from the focal length
    and the sensor size (pixel dimensions over focal plane resolution). EXIF's pixel dimensions are
    the camera's, so it also holds for photos that were reduced later; COLMAP's focal length in
    pixels is then too large by that factor.

    ``position`` is EXIF's, but for the altitude that XMP may have; XMP's place counts where EXIF
    has none. Its standard deviations are those of XMP, else EXIF's horizontal positioning error.
    """
    xmp = read_xmp(image.info.get("xmp"))
    try:
        main = image.getexif()
        tags: dict[int, Any] = {**main, **main.get_ifd(_EXIF_IFD)}
        gps: Mapping[int, Any] = main.get_ifd(_GPS_IFD)
    except Exception:  # Pillow's parser raises anything on broken bytes.
        tags, gps = {}, {}
    orientation = _integer(tags.get(0x0112))
    return Exif(
        make=_text(tags.get(0x010F)),
        model=_text(tags.get(0x0110)),
        focal_length_mm=_positive(tags.get(0x920A)),
        focal_length_35mm=_focal_length_35mm(tags, image.size),
        captured_at=_captured_at(tags),
        position=_position(gps, xmp),
        orientation=orientation if 1 <= orientation <= 8 else 1,
        gimbal=xmp.gimbal,
    )


def _focal_length_35mm(tags: Mapping[int, Any], size: tuple[int, int]) -> float | None:
    stated = _positive(tags.get(0xA405))
    if stated is not None:
        return stated
    focal_mm = _positive(tags.get(0x920A))
    mm_per_unit = _MM_PER_RESOLUTION_UNIT.get(_integer(tags.get(0xA210)))
    x_resolution, y_resolution = _positive(tags.get(0xA20E)), _positive(tags.get(0xA20F))
    if focal_mm is None or mm_per_unit is None or x_resolution is None:
        return None
    width = _positive(tags.get(0xA002)) or size[0]
    height = _positive(tags.get(0xA003)) or size[1]
    diagonal_mm = mm_per_unit * math.hypot(
        width / x_resolution, height / (y_resolution or x_resolution)
    )
    smallest, largest = _PLAUSIBLE_SENSOR_DIAGONAL_MM
    if not smallest <= diagonal_mm <= largest:
        return None
    return focal_mm * FULL_FRAME_DIAGONAL_MM / diagonal_mm


def _captured_at(tags: Mapping[int, Any]) -> datetime | None:
    """Local time on the camera's clock: when taken, else digitised, else last changed."""
    for time_tag, fraction_tag in ((0x9003, 0x9291), (0x9004, 0x9292), (0x0132, 0x9290)):
        try:
            when = datetime.strptime(_text(tags.get(time_tag)), "%Y:%m:%d %H:%M:%S")
        except ValueError:
            continue
        fraction = _text(tags.get(fraction_tag))
        if fraction.isascii() and fraction.isdigit():
            # Cut to six digits: rounding up could overflow the calendar.
            when += timedelta(microseconds=int(fraction[:6].ljust(6, "0")))
        return when
    return None


def _position(gps: Mapping[int, Any], xmp: Xmp) -> GeoPosition | None:
    place = _place(gps) or xmp.place
    if place is None:
        return None
    return GeoPosition(
        *place,
        # Where a drone does not know its altitude XMP says 0, and EXIF may know better.
        altitude_m=xmp.altitude_m or _altitude(gps),
        horizontal_sigma_m=xmp.horizontal_sigma_m or _positive(gps.get(0x001F)),
        vertical_sigma_m=xmp.vertical_sigma_m,
    )


def _place(gps: Mapping[int, Any]) -> tuple[float, float] | None:
    latitude = _degrees(gps.get(2), negative=_text(gps.get(1)).upper().startswith("S"))
    longitude = _degrees(gps.get(4), negative=_text(gps.get(3)).upper().startswith("W"))
    if latitude is None or longitude is None or abs(latitude) > 90 or abs(longitude) > 180:
        return None
    return latitude, longitude


def _altitude(gps: Mapping[int, Any]) -> float | None:
    altitude = _number(gps.get(6))
    if altitude is not None and gps.get(5) in (1, b"\x01"):  # Below sea level.
        altitude = -altitude
    return altitude


def _degrees(parts: Any, *, negative: bool) -> float | None:
    """(degrees, minutes, seconds) → degrees; later parts may be missing."""
    if not isinstance(parts, Sequence) or not 1 <= len(parts) <= 3:
        return None
    total = 0.0
    for part, unit in zip(parts, (1.0, 60.0, 3600.0), strict=False):
        value = _number(part)
        if value is None:
            return None
        total += value / unit
    return -total if negative else total


def _number(value: Any) -> float | None:
    if isinstance(value, tuple) and len(value) == 1:
        value = value[0]
    if isinstance(value, str | bytes):
        return None
    try:
        number = float(value)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return number if math.isfinite(number) else None


def _positive(value: Any) -> float | None:
    number = _number(value)
    return number if number is not None and number > 0 else None


def _integer(value: Any) -> int:
    return int(_number(value) or 0)


def _text(value: Any) -> str:
    """Text up to the first NUL: some cameras pad with NULs or leave old text behind them."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    return value.split("\0")[0].strip() if isinstance(value, str) else ""
