"""Where the photos of a model were taken and how they were held, for tables and maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.exporters.scene import Scene
from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.types import Float64Array, GeoPosition

_NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
# Forward is the top of the photo, right its right side, down where it looks.
_CAM_FROM_BODY = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True, eq=False)
class OnEarth:
    """``lat_lon_alt`` (3,) degrees, degrees, metres; ``yaw_pitch_roll_deg`` (3,) as in
    ``yaw_pitch_roll_deg``. ``residual_enu_m`` (3,): EXIF's position minus that in the model, None
    where EXIF has none or no altitude. ``horizontal_sigma_m``, ``vertical_sigma_m``: of EXIF's
    position, None where it says nothing."""

    lat_lon_alt: Float64Array
    yaw_pitch_roll_deg: Float64Array
    residual_enu_m: Float64Array | None
    horizontal_sigma_m: float | None
    vertical_sigma_m: float | None


@dataclass(frozen=True, slots=True, eq=False)
class CameraPosition:
    """``centre`` (3,): of projection, in the model's coordinates, which are east, north and up in
    metres if ``on_earth`` is there. ``quaternion`` (4,): w, x, y, z of the rotation from the model
    into the camera, whose axes are COLMAP's: x right, y down, z forward."""

    name: str
    centre: Float64Array
    quaternion: Float64Array
    on_earth: OnEarth | None


def camera_positions(scene: Scene) -> list[CameraPosition]:
    """All photos of the model, by name."""
    model = scene.model
    images = sorted(map(model.image, model.reg_image_ids()), key=lambda image: str(image.name))
    return [
        CameraPosition(
            name=image.name,
            centre=image.projection_center(),
            quaternion=np.roll(image.cam_from_world().rotation.quat, 1),
            on_earth=None
            if scene.frame is None
            else _on_earth(image, scene.frame, scene.positions.get(image.name)),
        )
        for image in images
    ]


def yaw_pitch_roll_deg(cam_from_enu: Float64Array) -> Float64Array:
    """(3, 3) rotation → (3,) degrees, as Metashape and Pix4D count them.

    All zero for a photo that looks straight down with its top to the north. Yaw turns the top
    clockwise, seen from above, from -180 to 180; then pitch lifts the view towards it, 90 being the
    horizon; then roll lowers the right side. Near pitch 90, a photo of a pedestrian, yaw and roll
    together are well defined, one alone is not.
    """
    ned_from_body = _NED_FROM_ENU @ cam_from_enu.T @ _CAM_FROM_BODY
    yaw = np.arctan2(ned_from_body[1, 0], ned_from_body[0, 0])
    pitch = np.arcsin(np.clip(-ned_from_body[2, 0], -1.0, 1.0))
    roll = np.arctan2(ned_from_body[2, 1], ned_from_body[2, 2])
    angles: Float64Array = np.degrees([yaw, pitch, roll])
    return angles


def _on_earth(image: pycolmap.Image, frame: LocalFrame, position: GeoPosition | None) -> OnEarth:
    residual = None
    if position is not None and position.altitude_m is not None:
        residual = frame.to_enu(lat_lon_alt([position]))[0] - image.projection_center()
    return OnEarth(
        lat_lon_alt=frame.to_wgs84(image.projection_center())[0],
        yaw_pitch_roll_deg=yaw_pitch_roll_deg(image.cam_from_world().rotation.matrix()),
        residual_enu_m=residual,
        horizontal_sigma_m=None if position is None else position.horizontal_sigma_m,
        vertical_sigma_m=None if position is None else position.vertical_sigma_m,
    )
