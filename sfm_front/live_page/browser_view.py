"""From where a browser looks at the scene: all of it in view, until its user moves."""

from __future__ import annotations

import numpy as np
import viser

from sfm_front.live_page.scene_view import view_of
from sfm_front.live_page.scenery import Scenery
from sfm_front.types import Float64Array
from sfm_front.viewers.viewpoint import VERTICAL_FIELD_OF_VIEW_DEG

# A view is changed if its eye moves by more than this share of its distance.
_LEAST_CHANGE = 0.06
# What a browser reports differs from what it was told by rounding.
_SAME = 1e-3


class BrowserView:
    """One browser's camera."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self._given: Float64Array | None = None
        self._framed: tuple[Scenery, float] | None = None

    def follow(self, scenery: Scenery, *, anyway: bool = False) -> None:
        """Keep the whole scene in view, unless its user has moved; ``anyway``: even then."""
        camera = self._client.camera
        framed = scenery, camera.aspect
        if not scenery.cameras.names or (framed == self._framed and not anyway):
            return
        is_same_window = self._framed is not None and self._framed[1] == camera.aspect
        self._framed = framed
        is_untouched = self._given is None or _distance(self._given, camera.position) < _SAME
        if not (is_untouched or anyway):
            return
        view = view_of(scenery, camera.aspect)
        reach = float(np.linalg.norm(view.eye - view.target))
        if self._given is not None and is_same_window and not anyway:
            change = float(np.linalg.norm(view.eye - self._given)) / reach
            if change < _LEAST_CHANGE:
                return
        with self._client.atomic():
            camera.position, camera.look_at = view.eye, view.target
            camera.fov = np.radians(VERTICAL_FIELD_OF_VIEW_DEG)
        self._given = view.eye


def set_first_view(server: viser.ViserServer, scenery: Scenery) -> None:
    """Let browsers begin with, and come back to, the whole scene."""
    if scenery.cameras.names:
        view, first = view_of(scenery), server.initial_camera
        first.position, first.look_at = view.eye, view.target
        first.fov = np.radians(VERTICAL_FIELD_OF_VIEW_DEG)


def _distance(one: Float64Array, two: Float64Array) -> float:
    return float(np.linalg.norm(one - two)) / max(float(np.linalg.norm(one)), 1e-9)
