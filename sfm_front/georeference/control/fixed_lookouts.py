"""Cameras that exist only in an adjustment, and hold a point where it was measured.

pycolmap knows no prior for points. But a camera that is far away, does not move and looks straight
at where a point was measured sees by how much it is off: its focal length makes one standard
deviation of the point as many pixels as one of a keypoint. One that looks down holds east and
north, one that looks north the height.
"""

from __future__ import annotations

from itertools import count

import numpy as np
import pycolmap

from sfm_front.types import Float64Array

# Of the two cameras that hold a point, in metres. So far away, rays are parallel: what is off by
# a metre along a ray changes what is seen across it by a millionth.
_DISTANCE_M = 1e6
# Looking down, x is east and y is south; looking north, x is east and y is down.
_DOWN = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
_NORTH = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
# Weight of the axis that a camera is not there for.
_NOTHING = 1e-6
# From a camera's side and from behind, a metre away, it is seen where it is. Rows are the axes of
# those who look, in its own.
_AROUND = (np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]), np.eye(3))
# How firmly a point is tied to a camera: much more so than any position is exact.
_TIE_SIGMA_M = 1e-3


class Lookouts:
    """Adds them to a ``model`` and to the ``config`` of its adjustment.

    ``pixel_sigma``: standard deviation of keypoints, in pixels.
    """

    def __init__(
        self,
        model: pycolmap.Reconstruction,
        config: pycolmap.BundleAdjustmentConfig,
        pixel_sigma: float,
    ) -> None:
        self._model, self._config, self._pixel_sigma = model, config, pixel_sigma
        self._camera_ids = count(max(model.cameras) + 1)
        # Frames and images of trivial rigs share their numbers.
        self._image_ids = count(max(max(model.images), max(model.frames)) + 1)
        # Rig id → the cameras around it.
        self._around: dict[int, list[int]] = {}

    def hold(self, track: pycolmap.Track, enu: Float64Array, sigmas: Float64Array) -> None:
        """Let the point of ``track`` be held at ``enu`` (3,), to ``sigmas`` (3,) in metres."""
        east, north, up = self._pixel_sigma * _DISTANCE_M / sigmas
        for rotation, focal_lengths in ((_DOWN, (east, north)), (_NORTH, (east * _NOTHING, up))):
            camera = self._camera(*focal_lengths)
            self._model.add_camera_with_trivial_rig(camera)
            image = self._image(camera.camera_id)
            centre = enu - _DISTANCE_M * rotation[2]
            cam_from_enu = pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), -rotation @ centre)
            self._model.add_image_with_trivial_frame(image, cam_from_enu)
            self._config.set_constant_rig_from_world_pose(
                self._model.image(image.image_id).frame_id
            )
            self._look(camera.camera_id, image.image_id, track)

    def tie(self, track: pycolmap.Track, image_id: int) -> None:
        """Let the point of ``track`` be where the camera of a photo is, wherever that moves to."""
        frame = self._model.frame(self._model.image(image_id).frame_id)
        if frame.rig_id not in self._around:
            self._around[frame.rig_id] = self._placed_around(self._model.rig(frame.rig_id))
        for camera_id in self._around[frame.rig_id]:
            image = self._image(camera_id)
            frame.add_data_id(image.data_id)
            image.frame_id = frame.frame_id
            self._model.add_image(image)
            self._look(camera_id, image.image_id, track)

    def _placed_around(self, rig: pycolmap.Rig) -> list[int]:
        """The ids of two more cameras of a rig, which move with it."""
        focal_length = self._pixel_sigma / _TIE_SIGMA_M
        camera_ids = []
        for axes in _AROUND:
            camera = self._camera(focal_length, focal_length)
            self._model.add_camera(camera)
            camera_from_rig = pycolmap.Rigid3d(pycolmap.Rotation3d(axes), np.array([0.0, 0, 1]))
            rig.add_sensor(camera.sensor_id, camera_from_rig)
            self._config.set_constant_sensor_from_rig_pose(camera.sensor_id)
            camera_ids.append(camera.camera_id)
        return camera_ids

    def _camera(self, focal_x: float, focal_y: float) -> pycolmap.Camera:
        return pycolmap.Camera(
            camera_id=next(self._camera_ids),
            model="PINHOLE",
            width=2,
            height=2,
            params=[focal_x, focal_y, 1, 1],
        )

    def _image(self, camera_id: int) -> pycolmap.Image:
        """What it sees is in the middle."""
        image_id = next(self._image_ids)
        return pycolmap.Image(
            name=f"lookout {image_id}",
            camera_id=camera_id,
            image_id=image_id,
            points2D=[pycolmap.Point2D(np.ones(2))],
        )

    def _look(self, camera_id: int, image_id: int, track: pycolmap.Track) -> None:
        self._config.add_image(image_id)
        self._config.set_constant_cam_intrinsics(camera_id)
        track.add_element(image_id, 0)
