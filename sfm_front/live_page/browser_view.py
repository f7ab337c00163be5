"""From where a browser looks at the scene: all of it in view, until its user moves."""

from __future__ import annotations

from collections import deque

import numpy as np
import viser

from sfm_front.live_page.scene_view import view_of
from sfm_front.live_page.scenery import Scenery
from sfm_front.types import Float64Array
from sfm_front.viewers.viewpoint import VERTICAL_FIELD_OF_VIEW_DEG

# A view is changed if its eye moves by more than this share of its distance.
_LEAST_CHANGE = 0.06
_ROUNDING = 1e-3


class BrowserView:
    """One browser's camera."""

    def __init__(self, client: viser.ClientHandle, first: Float64Array) -> None:
        """``first`` (3,): where it began to look from."""
        self._client = client
        # Where it was told to look from: elsewhere it is its user's choice.
        self._told = deque([first, client.camera.position], maxlen=8)
        self._framed: tuple[Scenery, float] | None = None

    def follow(self, scenery: Scenery, *, anyway: bool = False) -> None:
        """Keep the whole scene in view, unless its user has moved; ``anyway``: even then."""
        camera = self._client.camera
        here, aspect = camera.position, camera.aspect
        has_obeyed = _same(self._told[-1], here)
        if not scenery.cameras.names or not (
            anyway or any(_same(place, here) for place in self._told)
        ):
            return
        if (scenery, aspect) == self._framed and has_obeyed and not anyway:
            return
        is_same_window = self._framed is not None and self._framed[1] == aspect
        self._framed = scenery, aspect
        view = view_of(scenery, aspect)
        reach = float(np.linalg.norm(view.eye - view.target))
        change = float(np.linalg.norm(view.eye - here)) / reach
        if is_same_window and change < _LEAST_CHANGE and not anyway:
            return
        with self._client.atomic():
            camera.position, camera.look_at = view.eye, view.target
            camera.fov = np.radians(VERTICAL_FIELD_OF_VIEW_DEG)
        self._told.append(view.eye)


def set_first_view(server: viser.ViserServer, scenery: Scenery) -> None:
    """Let browsers begin with, and come back to, the whole scene."""
    if scenery.cameras.names:
        view, first = view_of(scenery), server.initial_camera
        first.position, first.look_at = view.eye, view.target
        first.fov = np.radians(VERTICAL_FIELD_OF_VIEW_DEG)


def _same(one: Float64Array, two: Float64Array) -> bool:
    """What a browser reports differs from what it was told by rounding."""
    length = max(float(np.linalg.norm(one)), 1e-9)
    return float(np.linalg.norm(one - two)) < _ROUNDING * length
