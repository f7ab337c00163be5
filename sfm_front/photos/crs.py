"""Coordinates in a reference system named by the user → WGS84."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from sfm_front.errors import DependencyError, InputError
from sfm_front.types import Float64Array

if TYPE_CHECKING:
    from pyproj import CRS
    from pyproj.transformer import TransformerGroup

ToWgs84: TypeAlias = Callable[[Float64Array], Float64Array]
"""(N, 3) x, y and height → (N, 3) latitude and longitude in degrees, altitude in metres.

x is the easting or the longitude, y the northing or the latitude; the height is nan where it is
not known.
"""

_WGS84 = re.compile(r"EPSG:(4326|4979)|WGS ?84", re.IGNORECASE)
_WGS84_UTM = re.compile(r"WGS ?84[ /]+UTM(?: zone)? +(\d{1,2})([NS])", re.IGNORECASE)
_PROJ_WGS84 = ({"+proj=longlat", "+datum=WGS84"}, {"+proj=latlong", "+datum=WGS84"})
_PROJ_ADDS_NOTHING = {"+ellps=WGS84", "+no_defs", "+no_defs=True", "+type=crs"}


def looks_like_crs(text: str) -> bool:
    """Whether a line of a file is meant as a reference system, known or not."""
    return bool(re.match(r"(EPSG:|WGS ?84|\+proj=|\+init=)", text, re.IGNORECASE))


def to_wgs84(name: str) -> ToWgs84:
    """What transforms from the system ``name``: ``EPSG:25832``, ``EPSG:25832+7837`` with that of
    the heights, ``WGS84 UTM 32N``, or a string of PROJ.

    Heights are taken as they are, in metres, unless the system says what they are above.

    Raises InputError if there is no such system, or if a grid is missing that its best known
    transformation needs; DependencyError for any but WGS84's latitude and longitude without pyproj.
    """
    name = name.strip().strip("'\"")
    if _WGS84.fullmatch(name) or _is_proj_wgs84(name):
        return _swapped
    try:
        import pyproj
        from pyproj.exceptions import CRSError
    except ImportError as error:
        raise DependencyError(
            f"{name}: other coordinates than WGS84's latitude and longitude need pyproj: install "
            'it with pip install "sfm-front[geo]", or convert them to EPSG:4326'
        ) from error
    utm = _WGS84_UTM.fullmatch(name)
    code = f"EPSG:{326 if utm[2].upper() == 'N' else 327}{int(utm[1]):02d}" if utm else name
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of PROJ strings being less exact than codes
            crs = pyproj.CRS.from_user_input(code)
    except CRSError:
        raise InputError(
            f"{name!r} is no reference system that PROJ knows: give one such as EPSG:25832 or "
            "WGS84 UTM 32N"
        ) from None
    return _transformation(name, crs)


def _transformation(name: str, crs: CRS) -> ToWgs84:
    from pyproj import CRS, Transformer
    from pyproj.exceptions import ProjError
    from pyproj.transformer import TransformerGroup

    if not (crs.is_geographic or crs.is_projected):
        raise InputError(f"{name}: is neither geographic nor projected: convert to EPSG:4326")
    has_heights = len(crs.axis_info) == 3
    target = CRS.from_epsg(4979 if has_heights else 4326)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what is refused below
            group = TransformerGroup(crs, target, always_xy=True, allow_ballpark=False)
        if not group.best_available:
            raise InputError(_missing_grid(name, group))
        transformer = Transformer.from_crs(
            crs, target, always_xy=True, only_best=True, allow_ballpark=False
        )
    except ProjError as error:
        raise InputError(f"{name}: PROJ cannot transform it to WGS84: {error}") from None
    in_metres = has_heights or crs.is_geographic or crs.axis_info[0].unit_conversion_factor == 1

    def transform(xyz: Float64Array) -> Float64Array:
        heights = xyz[:, 2]
        if not in_metres and np.isfinite(heights).any():
            raise InputError(
                f"{name}: is in {crs.axis_info[0].unit_name}, and does not say what heights are "
                "in: add the system of the heights, as in EPSG:2263+6360, or leave them out"
            )
        try:
            x, y, z = transformer.transform(
                xyz[:, 0], xyz[:, 1], np.nan_to_num(heights), errcheck=True
            )
        except ProjError as error:
            raise InputError(f"{name}: PROJ cannot transform these coordinates: {error}") from None
        return np.column_stack([y, x, np.where(np.isnan(heights), np.nan, z)])

    return transform


def _missing_grid(name: str, group: TransformerGroup) -> str:
    grids = {
        grid.short_name
        for operation in group.unavailable_operations[:1]
        for grid in operation.grids
        if not grid.available
    }
    missing = ", ".join(sorted(grids)) or "a grid"
    return (
        f"{name}: PROJ needs {missing} to transform it to WGS84: get it with pyproj sync --file, "
        "or convert the coordinates to EPSG:4326"
    )


def _swapped(xyz: Float64Array) -> Float64Array:
    return xyz[:, [1, 0, 2]]


def _is_proj_wgs84(name: str) -> bool:
    return set(name.split()) - _PROJ_ADDS_NOTHING in _PROJ_WGS84
