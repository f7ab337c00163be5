"""Rays of pixels against points that are projected to them."""

from __future__ import annotations

import numpy as np
import pycolmap

from sfm_front.geometry.rays import undistorted_rays


def test_rays_point_to_where_the_camera_sees():
    camera = pycolmap.Camera(
        model="RADIAL", width=1600, height=1200, params=[1300, 810, 590, -0.12, 0.03]
    )
    rays = np.array([[0.1, -0.2, 1.0], [0.0, 0.0, 1.0], [-0.4, 0.3, 1.0]])
    found = undistorted_rays(camera, camera.img_from_cam(rays))
    np.testing.assert_allclose(found, rays, atol=1e-9)


def test_a_pixel_that_cannot_be_undistorted_is_nan():
    # r (1 + k r²) has its largest value, 0.385, at r = 0.577: nothing is seen further out.
    camera = pycolmap.Camera(
        model="SIMPLE_RADIAL", width=1000, height=1000, params=[500, 500, 500, -1]
    )
    found = undistorted_rays(camera, np.array([[500.0, 500.0], [950.0, 500.0]]))
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1, :2]).all()


def test_no_pixels_have_no_rays():
    camera = pycolmap.Camera(model="PINHOLE", width=8, height=8, params=[5, 5, 4, 4])
    assert undistorted_rays(camera, np.zeros((0, 2))).shape == (0, 3)
