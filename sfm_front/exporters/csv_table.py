"""The positions of a model's photos as a table."""

from __future__ import annotations

import csv

from sfm_front.exporters.camera_positions import CameraPosition, OnEarth, camera_positions
from sfm_front.exporters.scene import Job

TABLE = "cameras.csv"

_QUATERNION = ("qw", "qx", "qy", "qz")
_MODEL = ("name", "x", "y", "z", *_QUATERNION)
_ON_EARTH = (
    *("name", "longitude_deg", "latitude_deg", "altitude_m", "east_m", "north_m", "up_m"),
    *("yaw_deg", "pitch_deg", "roll_deg", *_QUATERNION),
    *("residual_east_m", "residual_north_m", "residual_up_m"),
    *("horizontal_sigma_m", "vertical_sigma_m"),
)


def write(job: Job) -> list[str]:
    """``cameras.csv``, a line for each photo: see ``CameraPosition`` and ``OnEarth``.

    Of a model that is not georeferenced: coordinates of the model, whose unit nobody knows.
    """
    positions = camera_positions(job.scene)
    georeferenced = job.scene.frame is not None
    with (job.folder / TABLE).open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(_ON_EARTH if georeferenced else _MODEL)
        table.writerows(map(_row, positions))
    if georeferenced:
        return []
    return ["the model is not georeferenced: coordinates are its own, without a unit"]


def _row(position: CameraPosition) -> list[str]:
    centre = [_number(value, 6) for value in position.centre]
    quaternion = [_number(value, 9) for value in position.quaternion]
    on_earth = position.on_earth
    if on_earth is None:
        return [position.name, *centre, *quaternion]
    latitude, longitude, altitude = on_earth.lat_lon_alt
    place = [_number(longitude, 9), _number(latitude, 9), _number(altitude, 4)]
    angles = [_number(value, 4) for value in on_earth.yaw_pitch_roll_deg]
    return [position.name, *place, *centre, *angles, *quaternion, *_measured(on_earth)]


def _measured(on_earth: OnEarth) -> list[str]:
    residual = on_earth.residual_enu_m
    residuals = [""] * 3 if residual is None else [_number(value, 4) for value in residual]
    sigmas = (on_earth.horizontal_sigma_m, on_earth.vertical_sigma_m)
    return residuals + ["" if sigma is None else _number(sigma, 4) for sigma in sigmas]


def _number(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}"
