"""COLMAP's rig and frame where there is nothing to say: one camera, one image."""

from __future__ import annotations

import pycolmap


def trivial_rig(camera: pycolmap.Camera) -> pycolmap.Rig:
    """The rig of this camera alone, under its id."""
    rig = pycolmap.Rig(rig_id=camera.camera_id)
    rig.add_ref_sensor(camera.sensor_id)
    return rig


def trivial_frame(image: pycolmap.Image) -> pycolmap.Frame:
    """The frame of this image alone, under its id, on its camera's trivial rig."""
    frame = pycolmap.Frame(frame_id=image.image_id, rig_id=image.camera_id)
    frame.add_data_id(image.data_id)
    return frame
