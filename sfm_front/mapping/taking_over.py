"""An adjusted copy of a model, or of a part of it, put back into the model."""

from __future__ import annotations

import pycolmap


def take_over(model: pycolmap.Reconstruction, adjusted: pycolmap.Reconstruction) -> None:
    """Poses, cameras and points that both have become as in the second; what only one of them has
    stays. Errors of points are as before."""
    for frame_id in adjusted.reg_frame_ids():
        if model.exists_frame(frame_id):
            model.frame(frame_id).rig_from_world = adjusted.frame(frame_id).rig_from_world
    for camera_id, camera in adjusted.cameras.items():
        if model.exists_camera(camera_id):
            model.camera(camera_id).params = camera.params
    for point_id, point in adjusted.points3D.items():
        if model.exists_point3D(point_id):
            model.point3D(point_id).xyz = point.xyz
