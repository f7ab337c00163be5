"""The drone's poses and its camera."""

from __future__ import annotations

import numpy as np
import pycolmap
from numpy.typing import NDArray

CAMERA = pycolmap.Camera(
    camera_id=1,
    model="SIMPLE_RADIAL",
    width=1000,
    height=750,
    params=[812.4, 500.0, 375.0, -0.05],
)
_NUM_ORBIT = 13


def plan_flight(seed: int) -> list[pycolmap.Rigid3d]:
    """cam_from_world of every photo, in flight order: a survey, then an orbit."""
    rng = np.random.default_rng(seed)
    poses = []
    for line, northing in enumerate((-14.0, 14.0)):
        eastings = np.linspace(-33.0, 33.0, 4) + 3.0 * line
        for easting in eastings if line == 0 else eastings[::-1]:
            centre = np.array([easting, northing, 62.0]) + rng.normal(0.0, 1.0, 3)
            target = np.array([*centre[:2], 0.0]) + np.array([*rng.normal(0.0, 2.0, 2), 0.0])
            poses.append(look_at(centre, target, up=np.array([0.03 * rng.normal(), 1.0, 0.0])))
    for angle in np.deg2rad(-112.0 + np.arange(_NUM_ORBIT) * 360.0 / _NUM_ORBIT):
        radius, altitude = rng.normal(62.0, 2.0), rng.normal(45.0, 2.0)
        centre = np.array([radius * np.cos(angle), radius * np.sin(angle), altitude])
        target = np.array([0.0, 0.0, 4.0]) + rng.normal(0.0, 1.5, 3)
        poses.append(look_at(centre, target, up=np.array([*(0.02 * rng.normal(size=2)), 1.0])))
    return poses


def look_at(
    centre: NDArray[np.float64], target: NDArray[np.float64], *, up: NDArray[np.float64]
) -> pycolmap.Rigid3d:
    """cam_from_world of a camera at ``centre``; x right, y down and z forward, as in COLMAP."""
    forward = (target - centre) / np.linalg.norm(target - centre)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), -rotation @ centre)
