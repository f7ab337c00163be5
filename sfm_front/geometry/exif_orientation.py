"""How a camera was held, by EXIF's orientation."""

from __future__ import annotations

import numpy as np
import pycolmap

# Quarter turns clockwise that show a photo upright. Mirrored ones are turned alike.
QUARTER_TURNS = {1: 0, 2: 0, 3: 2, 4: 2, 5: 3, 6: 1, 7: 1, 8: 3}


def upright_from_cam(orientation: int) -> pycolmap.Rigid3d:
    """Turns a camera (x right, y down, z forward in the photo as stored) about its axis, so that
    its y axis points down in the photo as shown. ``orientation``: EXIF's, 1 to 8."""
    angle = QUARTER_TURNS[orientation] * np.pi / 2
    return pycolmap.Rigid3d(pycolmap.Rotation3d(np.array([0.0, 0.0, angle])), np.zeros(3))
