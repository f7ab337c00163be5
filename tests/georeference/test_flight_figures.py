"""Flying height, ground sampling distance and area."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest
from helpers.model_building import FOCAL, looking, make_model

from sfm_front.georeference.flight_figures import area_of_hull_m2, flight_figures

HEIGHT_M = 80.0
FROM_MODEL = pycolmap.Sim3d(4.0, pycolmap.Rotation3d(np.array([0.3, 1.0, -0.2])), [7.0, 8.0, 9.0])


def flown(points_enu: np.ndarray) -> pycolmap.Reconstruction:
    """Two cameras over flat ground that see all points; in a frame of its own."""
    ups = {"a": [40.0, 50.0, HEIGHT_M], "b": [60.0, 50.0, HEIGHT_M]}
    model = make_model({name: looking(at, [0, 0, -1], [0, 1, 0]) for name, at in ups.items()})
    for image in model.images.values():
        image.points2D = [pycolmap.Point2D([5.0, 5.0]) for _ in points_enu]
    for row, xyz in enumerate(points_enu):
        track = pycolmap.Track()
        for image_id in model.images:
            track.add_element(image_id, row)
        model.add_point3D(xyz, track, np.zeros(3, np.uint8))
    model.transform(FROM_MODEL.inverse())
    return model


def test_a_flight_over_flat_ground():
    east, north = np.meshgrid(np.linspace(0, 100, 21), np.linspace(0, 100, 21))
    ground = np.column_stack([east.ravel(), north.ravel(), np.zeros(east.size)])
    figures = flight_figures(flown(ground), FROM_MODEL)
    assert figures.height_m == pytest.approx(HEIGHT_M)
    # Slant: points are up to 64 m aside, half of them within some 40 m.
    nadir = 100 * HEIGHT_M / FOCAL
    assert nadir < figures.gsd_cm_per_px < 1.2 * nadir
    assert figures.area_m2 == pytest.approx(100 * 100, rel=0.01)


def test_photos_that_look_ahead_are_no_flight():
    wall = np.column_stack([np.linspace(0, 100, 50), np.full(50, 50.0), np.full(50, HEIGHT_M)])
    assert flight_figures(flown(wall), FROM_MODEL) is None


def test_without_points_there_are_no_figures():
    assert flight_figures(flown(np.zeros((0, 3))), FROM_MODEL) is None


def test_the_area_leaves_out_points_that_are_far_off():
    plane = np.random.default_rng(0).uniform(0, 100, (5000, 2))
    plane[:5] = 1e5
    assert area_of_hull_m2(plane) == pytest.approx(98 * 98, rel=0.02)
    assert area_of_hull_m2(np.zeros((2, 2))) == 0
