"""Where in front of its camera a pixel lies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sfm_front.types import Float64Array

if TYPE_CHECKING:
    import pycolmap


def undistorted_rays(camera: pycolmap.Camera, points: Float64Array) -> Float64Array:
    """(N, 2) pixels → (N, 3) directions in the camera, z = 1; nan where undistortion fails."""
    undistorted = np.asarray(camera.cam_from_img(points), np.float64)
    return np.column_stack([undistorted, np.ones(len(points))])
