"""A photo's XMP packet, however broken → what drones write there of position and gimbal."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from sfm_front.types import GimbalAngles

_LONGEST_PACKET = 2**20
# Makers use these prefixes alone, and some of their packets are no well-formed XML: properties are
# found by their names, as attributes or as elements.
_PROPERTY = re.compile(
    r"(?<![\w-])(drone-dji|Camera):(\w+)\s*(?:=\s*[\"']([^\"'<>]*)[\"']|>([^<>]*)</)"
)
_RTK_FIXED = 50.0


@dataclass(frozen=True, slots=True)
class Xmp:
    """What XMP says; ``None`` where it says nothing usable.

    ``place``: latitude and longitude in degrees; ``altitude_m`` above a datum that is not told.
    """

    place: tuple[float, float] | None = None
    altitude_m: float | None = None
    horizontal_sigma_m: float | None = None
    vertical_sigma_m: float | None = None
    gimbal: GimbalAngles | None = None


def read_xmp(packet: object) -> Xmp:
    """XMP of a packet as ``PIL.Image.Image.info`` has it, or of nothing. Never raises.

    DJI's own properties (``drone-dji``), and the accuracies of Pix4D's ``Camera``, which Parrot and
    senseFly write too. DJI's standard deviations count while its RTK solution is fixed: it writes
    them at other times as well, and is far off then.
    """
    if isinstance(packet, bytes):
        packet = packet[:_LONGEST_PACKET].decode("utf-8", errors="replace")
    if not isinstance(packet, str):
        return Xmp()
    numbers = _numbers(packet[:_LONGEST_PACKET])
    horizontal = _largest(numbers, "Camera:GPSXYAccuracy")
    vertical = _largest(numbers, "Camera:GPSZAccuracy")
    if numbers.get("drone-dji:RtkFlag") == _RTK_FIXED:
        horizontal = _largest(numbers, "drone-dji:RtkStdLon", "drone-dji:RtkStdLat") or horizontal
        vertical = _largest(numbers, "drone-dji:RtkStdHgt") or vertical
    return Xmp(
        place=_place(numbers),
        altitude_m=numbers.get("drone-dji:AbsoluteAltitude"),
        horizontal_sigma_m=horizontal,
        vertical_sigma_m=vertical,
        gimbal=_gimbal(numbers),
    )


def _numbers(packet: str) -> dict[str, float]:
    """Property by its name with prefix → value, of those that are finite numbers."""
    found: dict[str, float] = {}
    for prefix, name, attribute, element in _PROPERTY.findall(packet):
        try:
            value = float(attribute or element)
        except ValueError:
            continue
        if math.isfinite(value):
            found[f"{prefix}:{name}"] = value
    return found


def _largest(numbers: Mapping[str, float], *names: str) -> float | None:
    """The largest of these that is above 0."""
    return max((numbers[name] for name in names if numbers.get(name, 0) > 0), default=None)


def _place(numbers: Mapping[str, float]) -> tuple[float, float] | None:
    latitude = numbers.get("drone-dji:GpsLatitude")
    # Older firmware misspells it.
    longitude = numbers.get("drone-dji:GpsLongitude", numbers.get("drone-dji:GpsLongtitude"))
    if latitude is None or longitude is None or abs(latitude) > 90 or abs(longitude) > 180:
        return None
    return latitude, longitude


def _gimbal(numbers: Mapping[str, float]) -> GimbalAngles | None:
    angles = [numbers.get(f"drone-dji:Gimbal{name}Degree") for name in ("Yaw", "Pitch", "Roll")]
    known = [angle for angle in angles if angle is not None]
    return GimbalAngles(*known) if len(known) == len(angles) else None
