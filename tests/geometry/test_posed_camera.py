"""Rays of a posed photo against points projected into it."""

from __future__ import annotations

import numpy as np
from helpers.photo_stream import centre_of

from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.geometry.posed_camera import PosedCamera

RAY_TOLERANCE = 1e-5  # keypoints are float32


def test_rays_lead_from_the_centre_to_the_points():
    scene = make_scene(3, 200, seed=1, layout="orbit")
    pose = scene.cams_from_world[1]
    posed = PosedCamera(scene.camera, pose)
    in_camera = pose * scene.points
    ahead = scene.points[in_camera[:, 2] > 0]
    xy = scene.camera.img_from_cam(pose * ahead)
    inside = ((xy > 0) & (xy < [scene.camera.width, scene.camera.height])).all(axis=1)
    keypoints = np.zeros((inside.sum(), 4), np.float32)
    keypoints[:, :2] = xy[inside]
    expected = ahead[inside] - centre_of(pose)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert inside.sum() > 50
    np.testing.assert_allclose(posed.center, centre_of(pose))
    np.testing.assert_allclose(posed.rays(keypoints), expected, atol=RAY_TOLERANCE)


def test_the_relative_pose_takes_points_from_one_camera_to_the_other():
    scene = make_scene(3, 50, seed=1, layout="orbit")
    first, second = (PosedCamera(scene.camera, scene.cams_from_world[index]) for index in (0, 2))
    np.testing.assert_allclose(
        first.relative(second) * (first.cam_from_world * scene.points),
        second.cam_from_world * scene.points,
    )
