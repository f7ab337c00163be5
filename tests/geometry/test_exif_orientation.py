"""EXIF's orientation as a rotation of the camera."""

from __future__ import annotations

import numpy as np
import pytest

from sfm_front.geometry.exif_orientation import upright_from_cam


# Which way in the stored photo is down in the one that is shown: x right, y down.
@pytest.mark.parametrize(
    ("orientation", "down"), [(1, (0, 1)), (3, (0, -1)), (6, (1, 0)), (8, (-1, 0))]
)
def test_down_in_the_photo_as_shown(orientation: int, down: tuple[int, int]) -> None:
    shown = upright_from_cam(orientation).rotation.matrix() @ np.array([*down, 0.0])
    np.testing.assert_allclose(shown, [0, 1, 0], atol=1e-12)


def test_the_axis_stays() -> None:
    for orientation in range(1, 9):
        forward = upright_from_cam(orientation).rotation.matrix() @ np.array([0, 0, 1.0])
        np.testing.assert_allclose(forward, [0, 0, 1], atol=1e-12)
