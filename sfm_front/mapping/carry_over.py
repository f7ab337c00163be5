"""What refinement has changed in a copy of a model, carried over to the model, which has grown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.types import Float64Array


@dataclass(frozen=True)
class Before:
    """A model as it was when its copy was taken."""

    poses: dict[int, pycolmap.Rigid3d]
    points: dict[int, Float64Array]
    cameras: dict[int, Float64Array]

    @classmethod
    def of(cls, model: pycolmap.Reconstruction) -> Before:
        """Of a model now."""
        return cls(
            {i: model.image(i).cam_from_world() for i in model.reg_image_ids()},
            {i: model.point3D(i).xyz.copy() for i in model.point3D_ids()},
            {i: camera.params.copy() for i, camera in model.cameras.items()},
        )


def carry_over(
    live: pycolmap.Reconstruction,
    before: Before,
    refined: pycolmap.Reconstruction,
    neighbors: Mapping[int, list[int]],
) -> None:
    """Change a model that went on growing as refinement changed its copy.

    What both have moves as the copy did, on top of what has happened to it since. A photo that
    was registered since moves with the first of its ``neighbors`` that moves, a new point with the
    first photo of its track. ``neighbors``: image id of each such photo → those it has verified
    pairs with, most inliers first.
    """
    moves = {
        i: refined.image(i).cam_from_world().inverse() * pose
        for i, pose in before.poses.items()
        if refined.image(i).has_pose and live.image(i).has_pose
    }
    for image_id in live.reg_image_ids():
        if image_id not in moves:
            anchors = (moves[i] for i in neighbors[image_id] if i in moves)
            moves[image_id] = next(anchors, pycolmap.Rigid3d())
    for image_id in live.reg_image_ids():
        image = live.image(image_id)
        moved = image.cam_from_world() * moves[image_id].inverse()
        live.frame(image.frame_id).rig_from_world = moved  # a frame's only image is its camera
    for point_id in live.point3D_ids():
        point = live.point3D(point_id)
        if point_id in before.points and refined.exists_point3D(point_id):
            point.xyz = point.xyz + refined.point3D(point_id).xyz - before.points[point_id]
        else:
            point.xyz = moves[point.track.elements[0].image_id] * point.xyz
    for camera_id, params in before.cameras.items():
        camera = live.camera(camera_id)
        if refined.exists_camera(camera_id):
            changed = np.asarray(camera.params) + refined.camera(camera_id).params - params
            camera.params = changed.tolist()
