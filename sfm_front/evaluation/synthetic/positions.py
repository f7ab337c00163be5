"""Where a synthetic flight took its photos, and what GPS has of it."""

from __future__ import annotations

import numpy as np

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticScene
from sfm_front.geometry.enu import LocalFrame
from sfm_front.types import Float64Array, GeoPosition

# Where on earth the scene is, any place.
_TAKE_OFF = LocalFrame(47.0, 8.0, 400.0)


def measured_positions(scene: SyntheticScene, noise_m: float | None) -> list[GeoPosition | None]:
    """Of each photo, with this standard deviation along each axis, which they state; none without.

    Raises ConfigError for a noise that is not above 0.
    """
    if noise_m is None:
        return [None] * len(scene)
    if not 0 < noise_m < float("inf"):
        raise ConfigError(f"the noise of GPS must be a number of metres above 0, got {noise_m}")
    rng = np.random.default_rng([scene.seed, 2])
    measured = camera_centers(scene) + rng.normal(0.0, noise_m, (len(scene), 3))
    return [
        GeoPosition(latitude, longitude, altitude, noise_m, noise_m)
        for latitude, longitude, altitude in _TAKE_OFF.to_wgs84(measured).tolist()
    ]


def camera_centers(scene: SyntheticScene) -> Float64Array:
    """(N, 3) where the photos were taken; east, north and up in metres."""
    return np.array([pose.inverse().translation for pose in scene.cams_from_world])
