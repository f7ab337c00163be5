"""The scenery as nodes of a viser scene: few of them, changed in place, newest state kept."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from sfm_front.live_page import palette
from sfm_front.live_page.ground_drawing import GroundDrawing
from sfm_front.live_page.scene_view import view_of
from sfm_front.live_page.scenery import FRUSTUM_VERTICES, Cameras, Scenery
from sfm_front.types import Float64Array, Uint8Array

# Of a frustum: four sides and a base of two triangles.
_FACES = np.array(
    [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 2, 3], [1, 3, 4]], dtype=np.uint32
)

_LINE_PX = 1.5
_LINK_PX = 2.0
_FACE_OPACITY = 0.22
_MARK_SIZE = 0.12


class SceneDrawing:
    """What all browsers show; ``cameras`` is the node that is clicked on."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        # Nothing here has a shadow or shines; both would cost half of the pictures a second.
        scene.configure_default_lights(cast_shadow=False)
        scene.configure_environment_map(None)
        # Browsers complain of nodes without anything in them.
        nothing = np.zeros((1, 3), np.float32)
        self.points = scene.add_point_cloud(
            "/points", nothing, nothing.astype(np.uint8), precision="float32", visible=False
        )
        self.points.point_shape = "circle"
        self.points.point_shading = "flat"
        self.cameras = scene.add_batched_meshes_simple(
            "/cameras",
            FRUSTUM_VERTICES.astype(np.float32),
            _FACES,
            np.array([[1, 0, 0, 0]], np.float32),
            nothing,
            batched_scales=nothing,
            batched_colors=nothing.astype(np.uint8),
            opacity=_FACE_OPACITY,
            side="double",
            flat_shading=True,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._frusta = self._lines("/frusta", _LINE_PX)
        self.weak_links = self._lines("/weak_links", _LINK_PX)
        self.all_links = self._lines("/all_links", 1.0)
        self.links = self._lines("/newest/links", _LINK_PX)
        self.proposals = self._lines("/newest/proposals", 1.0)
        self._gaps = scene.add_point_cloud(
            "/gaps",
            nothing,
            palette.WAITING,
            point_size=_MARK_SIZE,
            point_shape="circle",
            precision="float32",
            visible=False,
        )
        self._labels: list[viser.LabelHandle] = []
        self._ground = GroundDrawing(scene)
        self.point_scale = 1.0
        self.shows_frusta = True
        self.shows_links = True
        self.shows_all_links = False

    def show(self, scenery: Scenery) -> None:
        """Change what has changed."""
        cameras = scenery.cameras
        points = scenery.points.astype(np.float32)
        self.points.visible = len(points) > 0
        if len(points):
            self.points.points, self.points.colors = points, scenery.colors
            self.points.point_size = scenery.point_size * self.point_scale
        self._show_cameras(cameras)
        links = self.shows_links
        _set_lines(self.links, scenery.links, palette.LINK, links)
        _set_lines(self.proposals, scenery.proposals, palette.FAINT, links)
        _set_lines(self.weak_links, scenery.weak_links, palette.WEAK, links)
        all_links = scenery.all_links if self.shows_all_links else np.zeros((0, 2, 3))
        _set_lines(self.all_links, all_links, palette.FAINT, True)
        self._gaps.visible = len(scenery.gaps) > 0
        if len(scenery.gaps):
            self._gaps.points = scenery.gaps.astype(np.float32)
        self._show_labels(_label_texts(scenery))
        eye = view_of(scenery).eye if cameras.names else np.zeros(3)
        self._ground.show(scenery.ground, eye)

    def _show_cameras(self, cameras: Cameras) -> None:
        self.cameras.visible = len(cameras.names) > 0 and self.shows_frusta
        if not cameras.names:
            self._frusta.visible = False
            return
        self.cameras.batched_positions = cameras.centres.astype(np.float32)
        self.cameras.batched_wxyzs = quaternions(cameras.rotations)
        self.cameras.batched_scales = cameras.sizes.astype(np.float32)
        self.cameras.batched_colors = cameras.colors
        _set_lines(
            self._frusta,
            cameras.segments(),
            np.repeat(cameras.colors, 8, axis=0),
            self.shows_frusta,
        )

    def _show_labels(self, labels: Sequence[tuple[str, Float64Array]]) -> None:
        for place, (text, position) in enumerate(labels):
            if place == len(self._labels):
                self._labels.append(
                    self._scene.add_label(
                        f"/labels/{place}", text, anchor="bottom-center", font_screen_scale=0.9
                    )
                )
            label = self._labels[place]
            label.text, label.position, label.visible = text, position, True
        for label in self._labels[len(labels) :]:
            label.visible = False

    def _lines(self, name: str, width_px: float) -> viser.LineSegmentsHandle:
        nothing = np.zeros((1, 2, 3), np.float32)
        return self._scene.add_line_segments(
            name,
            nothing,
            nothing.astype(np.uint8),
            thickness=width_px,
            thickness_units="screen",
            visible=False,
        )


def quaternions(rotations: Float64Array) -> NDArray[np.float32]:
    """(N, 3, 3) → (N, 4), w first."""
    turned: Any = viser.transforms.SO3.from_matrix(rotations)
    return np.asarray(turned.wxyz, np.float32).reshape(-1, 4)


def _label_texts(scenery: Scenery) -> list[tuple[str, Float64Array]]:
    """Of models, if they are several, and of what waits."""
    labels = []
    if len(scenery.tops) > 1:
        counts = np.bincount(scenery.cameras.models, minlength=len(scenery.tops))
        labels += [
            (f"model {model_id}: {count} photos", top)
            for model_id, count, top in zip(
                scenery.model_ids, counts.tolist(), scenery.tops, strict=True
            )
        ]
    for count, place in zip(scenery.gap_counts, scenery.gaps, strict=True):
        noun = "photo waits" if count == 1 else "photos wait"
        labels.append((f"{count} {noun}", place))
    return labels


def _set_lines(
    node: viser.LineSegmentsHandle,
    segments: Float64Array,
    colors: Uint8Array | palette.Color,
    visible: bool,
) -> None:
    """``colors``: one, or (N, 3) of the N segments."""
    node.visible = visible and len(segments) > 0
    if node.visible:
        rgb = np.broadcast_to(palette.linear(colors).reshape(-1, 1, 3), segments.shape)
        node.points, node.colors = segments.astype(np.float32), np.ascontiguousarray(rgb)
