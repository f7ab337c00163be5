"""Local frames whose axes point east, north and up."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.types import Float64Array, GeoPosition


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """East, north and up in metres from a point of the WGS84 ellipsoid.

    Heights are those of the origin's datum, whatever it is: nothing converts between ellipsoid and
    geoid. Their difference changes by some centimetres per kilometre.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float

    def to_enu(self, lat_lon_alt: Float64Array) -> Float64Array:
        """(N, 3) latitude and longitude in degrees, altitude in metres → (N, 3) metres; where the
        altitude is nan, so is up, and east and north are as at the origin's."""
        places = np.asarray(lat_lon_alt, np.float64).reshape(-1, 3)
        unknown = np.isnan(places[:, 2])
        level = np.where(unknown, self.altitude_m, places[:, 2])
        enu: Float64Array = _wgs84().ellipsoid_to_enu(
            np.column_stack([places[:, :2], level]), *self._origin
        )
        enu[unknown, 2] = np.nan
        return enu

    def to_wgs84(self, enu: Float64Array) -> Float64Array:
        """(N, 3) metres → (N, 3) latitude and longitude in degrees, altitude in metres."""
        lat_lon_alt: Float64Array = _wgs84().enu_to_ellipsoid(
            np.asarray(enu, np.float64).reshape(-1, 3), *self._origin
        )
        return lat_lon_alt

    @property
    def _origin(self) -> tuple[float, float, float]:
        return self.latitude_deg, self.longitude_deg, self.altitude_m


def lat_lon_alt(positions: Iterable[GeoPosition]) -> Float64Array:
    """(N, 3) degrees, degrees, metres; nan where the altitude is not known."""
    rows = [
        (p.latitude_deg, p.longitude_deg, np.nan if p.altitude_m is None else p.altitude_m)
        for p in positions
    ]
    return np.array(rows, np.float64).reshape(-1, 3)


def _wgs84() -> pycolmap.GPSTransform:
    # Its default is GRS80.
    return pycolmap.GPSTransform(pycolmap.GPSTransformEllipsoid.WGS84)
