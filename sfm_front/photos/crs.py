"""Coordinates in the reference systems that surveyors use → WGS84."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass, field
from typing import Any

from sfm_front.errors import DependencyError, InputError
from sfm_front.types import GeoPosition

_KNOWN = "Known are EPSG:4326, WGS84, WGS84 UTM 32N, EPSG:25832, or a PROJ string"
_UTM = re.compile(r"WGS[ _]?(?:19)?84\s*/?\s*UTM\s*(?:ZONE\s*)?(\d{1,2})\s*([NS])")
_MODERN_ELLIPSOIDS = ("WGS 84", "GRS 1980")


_MEANT_AS_ONE = re.compile(r"EPSG:|WGS[ _]?84|\+proj=|\+init=", re.IGNORECASE)


def looks_like_crs(line: str) -> bool:
    """Whether a line of a file is meant as a reference system, known or not."""
    return _MEANT_AS_ONE.match(line) is not None


@dataclass(frozen=True, slots=True)
class Crs:
    """A horizontal reference system; heights are kept as they are, whatever their datum.

    x comes before y, which is longitude before latitude, as in ODM's files.
    """

    name: str
    # None: the coordinates are WGS84 already.
    _way: _WayToWgs84 | None = field(default=None, repr=False, compare=False)

    @classmethod
    def parse(cls, text: str) -> Crs:
        """What ODM takes: ``EPSG:…``, ``WGS84``, ``WGS84 UTM 32N``, ``+proj=…``.

        InputError if it is none of these; DependencyError if it takes pyproj, as all but plain
        WGS84 do, and that is not there.
        """
        name = " ".join(text.split())
        return cls(name, None if _is_wgs84(name) else _WayToWgs84(name))

    def to_wgs84(self, x: float, y: float, z: float | None = None) -> GeoPosition:
        """``z`` in metres, None if not known.

        InputError if there is no such place, or PROJ lacks a grid that the exact way there needs.
        """
        longitude, latitude = x, y
        if self._way is not None:
            if z is not None and self._way.unit not in ("metre", "degree"):
                # Their heights mostly are in feet as well, but nothing says so.
                raise InputError(
                    f"{self.name} counts in {self._way.unit}, so the unit of its heights is open. "
                    "Convert the file to metres, or leave the heights out."
                )
            longitude, latitude = self._way.longitude_latitude(x, y)
        if not (abs(latitude) <= 90 and abs(longitude) <= 180):  # nan and inf fail as well.
            raise InputError(
                f"({x:g}, {y:g}) is no place in {self.name}. x (or longitude) comes first, "
                "then y (or latitude)."
            )
        if z is not None and not math.isfinite(z):
            raise InputError(f"The height {z} is not a number. Leave it out where it is not known.")
        return GeoPosition(latitude, longitude, z)


class _WayToWgs84:
    """What pyproj does with one reference system."""

    def __init__(self, name: str) -> None:
        try:
            import pyproj
        except ImportError as error:
            raise DependencyError(
                f"Coordinates in {name} need pyproj: pip install 'sfm-front[geo]'. "
                "WGS84 longitude and latitude (EPSG:4326) go without."
            ) from error
        self._name = name
        try:
            system = pyproj.CRS.from_user_input(_epsg_of_utm(name) or name)
            # Without the vertical part: else heights would be converted on the way.
            self._system = (system.sub_crs_list[0] if system.is_compound else system).to_2d()
            self._about = pyproj.Transformer.from_crs(self._system, "EPSG:4326", always_xy=True)
        except pyproj.exceptions.ProjError as error:
            raise InputError(
                f"{name!r} is no reference system that can be used: {error}. {_KNOWN}."
            ) from error
        if not (self._system.is_projected or self._system.is_geographic):
            raise InputError(f"{name} has no horizontal coordinates. {_KNOWN}.")
        self.unit = str(self._system.axis_info[0].unit_name)
        self._exact: Any = None

    def longitude_latitude(self, x: float, y: float) -> tuple[float, float]:
        """By one operation for all places, the best one at the first of them."""
        if self._exact is None:
            self._exact = self._best_at(*self._about.transform(x, y))
        longitude, latitude = self._exact.transform(x, y)
        return float(longitude), float(latitude)

    def _best_at(self, longitude: float, latitude: float) -> Any:
        from pyproj.aoi import AreaOfInterest
        from pyproj.transformer import TransformerGroup

        if not (abs(latitude) <= 90 and abs(longitude) <= 180):
            return self._about
        area = AreaOfInterest(longitude, latitude, longitude, latitude)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Of missing grids, which are an error here.
            # A Transformer's only_best does not notice grids that are not installed.
            ways = TransformerGroup(
                self._system,
                "EPSG:4326",
                always_xy=True,
                area_of_interest=area,
                # Without a datum only the ellipsoid tells whether it may pass for WGS84.
                allow_ballpark=self._system.ellipsoid.name in _MODERN_ELLIPSOIDS,
            )
        if not ways.best_available:
            grids = [g.short_name for g in ways.unavailable_operations[0].grids if not g.available]
            raise InputError(
                f"{self._name} → WGS84 needs a grid that is not installed: {', '.join(grids)}. "
                "Get it (pyproj sync --file NAME), or convert the file to WGS84."
            )
        if not ways.transformers:
            raise InputError(
                f"{self._name} does not say where it lies in the world. Give an EPSG code, or "
                "+datum or +towgs84 in the PROJ string."
            )
        return ways.transformers[0]


def _is_wgs84(name: str) -> bool:
    words = set(name.split()) - {"+no_defs", "+type=crs"}
    degrees = words & {"+proj=longlat", "+proj=latlong"}
    return name.upper() in ("EPSG:4326", "EPSG:4979", "WGS84", "WGS_84", "WGS 84") or (
        bool(degrees) and words - degrees <= {"+datum=WGS84", "+ellps=WGS84"}
    )


def _epsg_of_utm(name: str) -> str | None:
    found = _UTM.fullmatch(name.upper())
    if found is None or not 1 <= int(found[1]) <= 60:
        return None
    return f"EPSG:{326 if found[2] == 'N' else 327}{int(found[1]):02d}"
