"""The positions of a model's photos as GeoJSON (RFC 7946)."""

from __future__ import annotations

import json
from typing import Any

from sfm_front.errors import InputError
from sfm_front.exporters.camera_positions import CameraPosition, OnEarth, camera_positions
from sfm_front.exporters.scene import Job
from sfm_front.georeference.sidecar import FILE_NAME

MAP = "cameras.geojson"


def write(job: Job) -> list[str]:
    """``cameras.geojson``: a point for each photo, longitude, latitude, altitude, with the rest of
    ``CameraPosition`` and ``OnEarth`` for properties.

    Altitudes are those of the georeference's datum; RFC 7946 means heights above the ellipsoid.
    Raises InputError for a model that is not georeferenced.
    """
    features = [
        _feature(position, position.on_earth)
        for position in camera_positions(job.scene)
        if position.on_earth is not None
    ]
    if not features:
        raise InputError(
            f"the model is not georeferenced (no {FILE_NAME} beside it says so), and GeoJSON "
            "has no other coordinates; reconstruct from photos with GPS, or export --to csv"
        )
    content = {"type": "FeatureCollection", "features": features}
    (job.folder / MAP).write_text(
        json.dumps(content, ensure_ascii=False, indent=1) + "\n", encoding="utf-8"
    )
    return []


def _feature(position: CameraPosition, on_earth: OnEarth) -> dict[str, Any]:
    latitude, longitude, altitude = (float(value) for value in on_earth.lat_lon_alt)
    yaw, pitch, roll = (round(float(value), 4) for value in on_earth.yaw_pitch_roll_deg)
    residual = on_earth.residual_enu_m
    return {
        "type": "Feature",
        "geometry": {
            "type": "Point",
            "coordinates": [round(longitude, 9), round(latitude, 9), round(altitude, 4)],
        },
        "properties": {
            "name": position.name,
            "enu_m": [round(float(value), 4) for value in position.centre],
            "yaw_deg": yaw,
            "pitch_deg": pitch,
            "roll_deg": roll,
            "residual_enu_m": None
            if residual is None
            else [round(float(value), 4) for value in residual],
            "horizontal_sigma_m": on_earth.horizontal_sigma_m,
            "vertical_sigma_m": on_earth.vertical_sigma_m,
        },
    }
