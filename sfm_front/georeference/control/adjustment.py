"""Bundle adjustment of a model that control points hold."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.georeference.control.triangulation import Sighting
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions, robust_adjustment
from sfm_front.types import Float64Array

# Of the two cameras that hold a point, in metres. So far away, rays are parallel: what is off by
# a metre along a ray changes what is seen across it by a millionth.
_DISTANCE_M = 1e6
# Looking down, x is east and y is south; looking north, x is east and y is down.
_DOWN = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
_NORTH = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
# Weight of the axis that a camera is not there for.
_NOTHING = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class HeldPoint:
    """``enu`` (3,) where it was surveyed, ``sigmas`` (3,) in metres, ``xyz`` (3,) where it is."""

    enu: Float64Array
    sigmas: Float64Array
    xyz: Float64Array
    sightings: Sequence[Sighting]


def adjust_with_control(
    reconstruction: pycolmap.Reconstruction,
    held: Sequence[HeldPoint],
    options: RobustAdjustmentOptions,
    pixel_sigma: float,
) -> None:
    """Adjust a whole model in ENU, which these points hold: at least three, not on a line.

    ``pixel_sigma``: standard deviation of keypoints and marks, in pixels.

    pycolmap knows no prior for points. But a camera that is far away, does not move and looks
    straight at where a point was surveyed sees by how much it is off: its focal length makes one
    standard deviation of the point as many pixels as one of a keypoint. One that looks down holds
    east and north, one that looks north the height. They fix the gauge as well.

    The first adjustment has plain squares, for a bent model is off by many standard deviations,
    which a robust loss would take for blunders.
    """
    model = copy.deepcopy(reconstruction)
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in model.reg_image_ids():
        config.add_image(image_id)
    for point in held:
        _hold(model, config, point, pixel_sigma)
    for loss in (pycolmap.LossFunctionType.TRIVIAL, pycolmap.LossFunctionType.CAUCHY):
        adjustment = robust_adjustment(options, reconstruction.num_reg_images())
        adjustment.ceres.loss_function_type = loss
        pycolmap.create_default_bundle_adjuster(adjustment, config, model).solve()
    _take_back(reconstruction, model)


def _hold(
    model: pycolmap.Reconstruction,
    config: pycolmap.BundleAdjustmentConfig,
    point: HeldPoint,
    pixel_sigma: float,
) -> None:
    """Enter the point with its marks, and the two cameras that hold it."""
    track = pycolmap.Track()
    for sighting in point.sightings:
        image = model.image(sighting.image.image_id)
        image.points2D.append(pycolmap.Point2D(sighting.xy))
        track.add_element(image.image_id, len(image.points2D) - 1)
    east, north, up = pixel_sigma * _DISTANCE_M / point.sigmas
    for rotation, focal_lengths in (
        (_DOWN, (east, north)),
        (_NORTH, (east * _NOTHING, up)),
    ):
        camera_id = max(model.cameras) + 1
        camera = pycolmap.Camera(
            camera_id=camera_id, model="PINHOLE", width=2, height=2, params=[*focal_lengths, 1, 1]
        )
        model.add_camera_with_trivial_rig(camera)
        image_id = max(max(model.images), max(model.frames)) + 1
        image = pycolmap.Image(
            name=f"control {image_id}",
            camera_id=camera_id,
            image_id=image_id,
            points2D=[pycolmap.Point2D(np.ones(2))],
        )
        centre = point.enu - _DISTANCE_M * rotation[2]
        cam_from_enu = pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), -rotation @ centre)
        model.add_image_with_trivial_frame(image, cam_from_enu)
        config.add_image(image_id)
        config.set_constant_cam_intrinsics(camera_id)
        config.set_constant_rig_from_world_pose(model.image(image_id).frame_id)
        track.add_element(image_id, 0)
    model.add_point3D(point.xyz, track)


def _take_back(reconstruction: pycolmap.Reconstruction, adjusted: pycolmap.Reconstruction) -> None:
    """What is in both becomes as in the second."""
    for frame_id in reconstruction.reg_frame_ids():
        frame = reconstruction.frame(frame_id)
        frame.rig_from_world = adjusted.frame(frame_id).rig_from_world
    for camera_id, camera in reconstruction.cameras.items():
        camera.params = adjusted.camera(camera_id).params
    for point_id in reconstruction.point3D_ids():
        reconstruction.point3D(point_id).xyz = adjusted.point3D(point_id).xyz
    reconstruction.update_point_3d_errors()
