"""What one browser has chosen to see of one photo; other browsers see their own."""

from __future__ import annotations

from threading import RLock
from typing import Any

import numpy as np
import viser

from sfm_front.live_page import palette, photo_words
from sfm_front.live_page.follower import Seen
from sfm_front.live_page.photo_pictures import PhotoPictures
from sfm_front.live_page.scene_drawing import quaternions
from sfm_front.live_page.scenery import Cameras, Scenery
from sfm_front.reports.html.markup import visible

_PICTURE_PX = 640
_FRUSTUM_PX = 400
_WIDTH_PX = 330
_EMPTY = np.full((3, 4, 3), 128, np.uint8)
_HINT = "click a camera, or choose"
# How far behind a photo's camera one stands to look through it, in depths of its frustum.
_BEHIND = 1.2


class PhotoPanel:
    """A panel at the left, and a frustum with the picture and lines to the photos it matches."""

    def __init__(self, client: viser.ClientHandle, pictures: PhotoPictures) -> None:
        self._client, self._pictures = client, pictures
        self._lock = RLock()
        self._name: str | None = None
        self._state: tuple[Seen, Scenery] | None = None
        # What stands in the list → the photo.
        self._choices: dict[str, str] = {}
        self._nodes: list[Any] = []
        # The photo that they show.
        self._drawn: str | None = None
        gui = client.gui
        panel = gui.add_panel()
        with panel.add_tab("Photo"):
            self._list = gui.add_dropdown("show", (_HINT,))
            self._picture = gui.add_image(_EMPTY, visible=False)
            self._through = gui.add_button("Look through it", visible=False)
            self._matches = gui.add_image(_EMPTY, visible=False)
            self._figures = gui.add_html("", visible=False)
        panel.float(x=12, y=12, width=_WIDTH_PX)
        self._list.on_update(lambda _: self._choose())
        self._through.on_click(lambda _: self._look_through())

    def show(self, seen: Seen, scenery: Scenery) -> None:
        """Follow what has changed."""
        with self._lock:
            self._state = seen, scenery
            self._choices = _choices(seen)
            options = (_HINT, *self._choices)
            if options != self._list.options:
                self._list.options = options
            if self._name is not None:
                self._draw()

    def open(self, name: str) -> None:
        """Show a photo by its name."""
        shown = next((text for text, known in self._choices.items() if known == name), None)
        if shown is not None:
            self._list.value = shown
        with self._lock:
            self._open(name)

    def _choose(self) -> None:
        name = self._choices.get(self._list.value)
        with self._lock:
            if name is not None and name != self._name:
                self._open(name)

    def _open(self, name: str) -> None:
        if self._state is None or name not in self._state[0].outcomes:
            return
        self._name = name
        seen, scenery = self._state
        picture = self._pictures.upright(name, _PICTURE_PX)
        self._picture.visible = picture is not None
        if picture is not None:
            self._picture.image = picture
        self._draw()
        self._through.visible = scenery.cameras.index(name) is not None
        self._draw_matches(seen, name)

    def _draw(self) -> None:
        assert self._state is not None
        assert self._name is not None
        seen, scenery = self._state
        outcome = seen.outcomes.get(self._name)
        if outcome is None:  # Another session has taken the place of the one before.
            self._name = None
            self._figures.visible = self._picture.visible = self._matches.visible = False
            self._remove_nodes()
            return
        pairs = self._pairs(seen, self._name)
        shape = None if outcome.model is None else seen.models[outcome.model]
        observed = 0
        if shape is not None and self._name in shape.names:
            observed = int(shape.num_observed[list(shape.names).index(self._name)])
        self._figures.content = str(photo_words.photo_figures(seen, outcome, pairs, observed))
        self._figures.visible = True
        self._draw_nodes(scenery, [name for name, _ in pairs])

    def _draw_nodes(self, scenery: Scenery, matched: list[str]) -> None:
        """The frustum with the picture, and lines to the photos that it matches."""
        assert self._name is not None
        cameras, index = scenery.cameras, scenery.cameras.index(self._name)
        if index is None or self._name != self._drawn:
            self._remove_nodes()
        if index is None:
            return
        if self._drawn is None:
            self._add_nodes(cameras, index)
        frustum, lines = self._nodes
        frustum.wxyz = quaternions(cameras.rotations[index][None])[0]
        frustum.position = cameras.centres[index]
        # A little larger than the one that all see, so that it lies before it.
        depth = float(cameras.sizes[index][2])
        frustum.scale = 1.02 * depth / frustum.compute_canonical_frustum_size()[2]
        at = {name: place for place, name in enumerate(cameras.names)}
        ends = [at[name] for name in matched if name in at]
        lines.visible = len(ends) > 0
        if ends:
            starts = np.repeat(cameras.centres[index][None], len(ends), axis=0)
            lines.points = np.stack([starts, cameras.centres[ends]], axis=1).astype(np.float32)

    def _add_nodes(self, cameras: Cameras, index: int) -> None:
        width, height, depth = cameras.sizes[index].tolist()
        scene, name = self._client.scene, cameras.names[index]
        frustum = scene.add_camera_frustum(
            "/selected/frustum",
            fov=2 * float(np.arctan2(height, depth)),
            aspect=width / height,
            color=palette.LINK,
            image=self._pictures.stored(name, _FRUSTUM_PX),
            thickness=2.5,
            thickness_units="screen",
            cast_shadow=False,
            receive_shadow=False,
        )
        lines = scene.add_line_segments(
            "/selected/links",
            np.zeros((1, 2, 3), np.float32),
            palette.LINK,
            thickness=2.0,
            thickness_units="screen",
            visible=False,
        )
        self._nodes, self._drawn = [frustum, lines], name

    def _remove_nodes(self) -> None:
        for node in self._nodes:
            node.remove()
        self._nodes, self._drawn = [], None

    def _draw_matches(self, seen: Seen, name: str) -> None:
        """With the photo that it matches best."""
        pairs = self._pairs(seen, name)
        drawn = None
        if pairs:
            one, two = (seen.outcomes[other].photo for other in (name, pairs[0][0]))
            if one.image_id is not None and two.image_id is not None:
                drawn = self._pictures.matches((one.name, one.image_id), (two.name, two.image_id))
        self._matches.visible = drawn is not None
        if drawn is not None:
            self._matches.image = drawn

    def _pairs(self, seen: Seen, name: str) -> list[tuple[str, int]]:
        """Photos that it matches and their inliers, the most first."""
        return self._pictures.pairs(seen.story, name)

    def _look_through(self) -> None:
        """Put this browser's camera where the photo's was."""
        with self._lock:
            if self._state is None or self._name is None:
                return
            cameras = self._state[1].cameras
            index = cameras.index(self._name)
            if index is None:
                return
            ahead = cameras.rotations[index][:, 2]
            depth = float(cameras.sizes[index][2])
            centre = cameras.centres[index]
        with self._client.atomic():
            self._client.camera.position = centre - _BEHIND * depth * ahead
            self._client.camera.look_at = centre + depth * ahead


def _choices(seen: Seen) -> dict[str, str]:
    """Names as they can be shown → names; two that look alike are told apart by a number."""
    choices: dict[str, str] = {}
    for name in seen.outcomes:
        text = shown = visible(name)
        number = 1
        while shown in choices:
            number += 1
            shown = f"{text} ({number})"
        choices[shown] = name
    return choices
