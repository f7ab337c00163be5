"""How far a model's cameras are from where GPS had them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from sfm_front.types import GeoPosition

if TYPE_CHECKING:
    import pycolmap

_MIN_POSITIONS = 4  # a similarity fits any two of them, and nearly any three


def gps_residual_m(
    model: pycolmap.Reconstruction, positions: Mapping[str, GeoPosition]
) -> float | None:
    """Median distance in metres between the cameras and their GPS positions, by name of the photo.

    The model is moved, turned and scaled to fit them by least squares (Umeyama, "Least-squares
    estimation of transformation parameters between two point patterns", PAMI 1991), in a local
    frame whose axes point east, north and up. None for fewer than four positions with an altitude,
    or if they lie in one plane.
    """
    import pycolmap

    located = [
        (model.images[image_id].projection_center(), position)
        for image_id in model.reg_image_ids()
        if (position := positions.get(model.images[image_id].name)) is not None
        and position.altitude_m is not None
    ]
    if len(located) < _MIN_POSITIONS:
        return None
    centres = np.array([centre for centre, _ in located])
    lat_lon_alt = np.array(
        [(p.latitude_deg, p.longitude_deg, p.altitude_m) for _, p in located], np.float64
    )
    wgs84 = pycolmap.GPSTransform(pycolmap.GPSTransformEllipsoid.WGS84)
    enu = wgs84.ellipsoid_to_enu(lat_lon_alt, *lat_lon_alt.mean(axis=0))
    enu_from_model = pycolmap.estimate_sim3d(centres, enu)
    if enu_from_model is None:
        return None
    fitted = np.array([enu_from_model * centre for centre in centres])
    return float(np.median(np.linalg.norm(fitted - enu, axis=1)))
