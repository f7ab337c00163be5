"""A photo whose camera and pose are known: where it stands, and what its keypoints look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.geometry.rays import undistorted_rays
from sfm_front.types import Float32Array, Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class PosedCamera:
    """A photo's camera and pose in the world frame."""

    camera: pycolmap.Camera
    cam_from_world: pycolmap.Rigid3d

    @property
    def center(self) -> Float64Array:
        """Projection centre, (3,), in world coordinates."""
        return np.asarray(self.cam_from_world.inverse().translation, np.float64)

    def rays(self, keypoints: Float32Array) -> Float64Array:
        """(N, 3) unit directions of keypoints (N, 4) in world coordinates.

        nan where undistortion fails.
        """
        rays = undistorted_rays(self.camera, keypoints[:, :2].astype(np.float64))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        directions: Float64Array = rays @ self.cam_from_world.rotation.matrix()
        return directions

    def project(self, points: Float64Array) -> Float64Array:
        """(N, 2) pixels of points (N, 3) in world coordinates; nan for those behind the camera."""
        in_camera = points @ self.cam_from_world.rotation.matrix().T
        in_camera += self.cam_from_world.translation
        pixels = np.asarray(self.camera.img_from_cam(in_camera), np.float64).reshape(-1, 2)
        pixels[in_camera[:, 2] <= 0] = np.nan
        return pixels

    def relative(self, other: PosedCamera) -> pycolmap.Rigid3d:
        """Pose of the other photo, as seen from this one: cam2_from_cam1, translation as long as
        the baseline."""
        return other.cam_from_world * self.cam_from_world.inverse()
