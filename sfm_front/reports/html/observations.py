"""The points of a model and who sees them, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.storage.model_keypoints import read_point_keypoints
from sfm_front.types import Float64Array, Uint8Array

IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Of N points seen M times by I registered photos.

    ``image_ids`` (I,), ``centres`` (I, 3) and ``world_from_cam`` (I, 3, 3), rotations, of the
    photos; ``xyz`` (N, 3) and ``colors`` (N, 3) of the points. ``photo`` (M,) and ``point`` (M,):
    rows of the above; ``xy`` (M, 2): keypoints, and ``residuals_px`` (M, 2): keypoint less
    projection, nan behind the camera, both in pixels of the file.
    """

    image_ids: IntArray
    centres: Float64Array
    world_from_cam: Float64Array
    xyz: Float64Array
    colors: Uint8Array
    photo: IntArray
    point: IntArray
    xy: Float64Array
    residuals_px: Float64Array

    @property
    def track_lengths(self) -> IntArray:
        """(N,) photos that see each point."""
        return np.bincount(self.point, minlength=len(self.xyz)).astype(np.int64)

    @property
    def points_seen(self) -> dict[int, int]:
        """Points that each photo sees, by image id."""
        counts = np.bincount(self.photo, minlength=len(self.image_ids))
        return dict(zip(self.image_ids.tolist(), counts.tolist(), strict=True))


def observations_of(model: pycolmap.Reconstruction, folder: Path) -> Observations:
    """Of a model as it was read from ``folder``. Raises InputError if its file of images is gone
    or broken."""
    point_ids = np.array(sorted(model.point3D_ids()), np.int64)
    points = [model.points3D[point_id] for point_id in point_ids.tolist()]
    xyz = np.array([point.xyz for point in points], np.float64).reshape(-1, 3)
    images = [model.images[image_id] for image_id in sorted(model.reg_image_ids())]
    poses = [image.cam_from_world().inverse() for image in images]
    keypoints = read_point_keypoints(folder)
    seen = [keypoints[image.image_id] for image in images]
    rows = [np.searchsorted(point_ids, of_photo.point_ids) for of_photo in seen]
    residuals = [
        of_photo.xy
        - PosedCamera(model.cameras[image.camera_id], image.cam_from_world()).project(xyz[row])
        for image, of_photo, row in zip(images, seen, rows, strict=True)
    ]
    return Observations(
        image_ids=np.array([image.image_id for image in images], np.int64),
        centres=np.array([pose.translation for pose in poses], np.float64).reshape(-1, 3),
        world_from_cam=np.array([pose.rotation.matrix() for pose in poses]).reshape(-1, 3, 3),
        xyz=xyz,
        colors=np.array([point.color for point in points], np.uint8).reshape(-1, 3),
        photo=np.repeat(np.arange(len(images)), [len(row) for row in rows]),
        point=np.concatenate([*rows, np.zeros(0, np.int64)]),
        xy=np.concatenate([*(of_photo.xy for of_photo in seen), np.zeros((0, 2))]),
        residuals_px=np.concatenate([*residuals, np.zeros((0, 2))]),
    )
