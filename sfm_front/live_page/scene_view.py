"""A view of the whole scene."""

from __future__ import annotations

import numpy as np

from sfm_front.live_page.scenery import Scenery
from sfm_front.viewers.viewpoint import View, choose_view

# Of a window beside the panel, before a browser has told its own.
_ASPECT = 1.4
# Points that decide what is in view.
_MOST_POINTS = 5000


def view_of(scenery: Scenery, aspect: float = _ASPECT) -> View:
    """From behind and above its cameras, of which there must be one; ``aspect``: width over
    height."""
    cameras = scenery.cameras
    step = max(len(scenery.points) // _MOST_POINTS, 1)
    corners = cameras.segments().reshape(-1, 3)
    if scenery.ground is not None:
        corners = np.concatenate([corners, scenery.ground.corners()])
    return choose_view(scenery.points[::step], corners, cameras.rotations, cameras.centres, aspect)
