"""Points as discs in a picture, by numpy alone: Open3D must not load where photos are mapped."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw

from sfm_front.types import Float64Array
from sfm_front.viewers.model_drawing import Scene
from sfm_front.viewers.viewpoint import VERTICAL_FIELD_OF_VIEW_DEG, View

# Drawn so many times larger, and reduced: edges become smooth.
_FINER = 2
# More would cover each other.
_MAX_POINTS = 150_000
_MAX_RADIUS_PX = 5.0
_FRUSTUM_PX = 1.3
# In front of the eye, as a share of the distance to the farthest point.
_NEAREST = 1e-3


def splat(
    pixels: Float64Array,
    depths: Float64Array,
    colors: Float64Array,
    size: tuple[int, int],
    radius_px: float,
) -> Image.Image:
    """Discs at ``pixels`` (N, 2) that hide those of larger ``depths`` (N,), transparent elsewhere.

    ``colors`` (N, 3) in [0, 1]; ``size`` is (width, height). RGBA, ``_FINER`` times larger.
    """
    width, height = (_FINER * side for side in size)
    radius = _FINER * radius_px
    reach = np.arange(-int(radius), int(radius) + 1)
    dx, dy = (offsets.ravel() for offsets in np.meshgrid(reach, reach))
    inside = dx**2 + dy**2 <= radius**2
    # The nearest last, for it is what stays.
    order = np.argsort(-depths, kind="stable")
    at = np.floor(_FINER * pixels[order]).astype(np.int64)
    x = (at[:, :1] + dx[inside]).ravel()
    y = (at[:, 1:] + dy[inside]).ravel()
    rows = np.repeat(order, int(inside.sum()))
    visible = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    picture = np.zeros((height * width, 4), np.uint8)
    rgba = np.full((len(colors), 4), 255, np.uint8)
    rgba[:, :3] = np.round(255 * colors)
    picture[y[visible] * width + x[visible]] = rgba[rows[visible]]
    return Image.fromarray(picture.reshape(height, width, 4))


def reduced(picture: Image.Image) -> Image.Image:
    """What ``splat`` made, at the size it was asked for."""
    # Premultiplied: else the black of what is transparent would frame each disc.
    size = picture.width // _FINER, picture.height // _FINER
    return picture.convert("RGBa").resize(size, Image.Resampling.BOX).convert("RGBA")


def fitting_radius_px(num_points: int, size: tuple[int, int]) -> float:
    """Larger discs for fewer points, so that clouds look equally dense."""
    per_point = size[0] * size[1] / max(num_points, 1)
    return float(np.clip(0.16 * np.sqrt(per_point), 0.8, _MAX_RADIUS_PX))


def evenly(count: int) -> slice:
    """Which of so many points are drawn."""
    return slice(None, None, max(-(-count // _MAX_POINTS), 1))


def draw_scene(scene: Scene, view: View, size: tuple[int, int]) -> Image.Image:
    """A scene in perspective, frusta over points; transparent where nothing is. RGBA."""
    kept = evenly(len(scene.points))
    points, colors = scene.points[kept], scene.point_colors[kept]
    pixels, depths = _projected(points, view, size)
    nearest = _NEAREST * float(depths.max(initial=0.0))
    front = depths > nearest
    radius = fitting_radius_px(len(points), size)
    picture = splat(pixels[front], depths[front], colors[front], size, radius)
    _draw_lines(picture, scene, view, size, nearest)
    return reduced(picture)


def _draw_lines(
    picture: Image.Image, scene: Scene, view: View, size: tuple[int, int], nearest: float
) -> None:
    pixels, depths = _projected(scene.vertices, view, size)
    ends, canvas = _FINER * pixels[scene.lines], ImageDraw.Draw(picture)
    line_depths = depths[scene.lines]
    colors = np.round(255 * scene.line_colors).astype(int).tolist()
    for row in np.argsort(-line_depths.mean(axis=1), kind="stable").tolist():
        if line_depths[row].min() > nearest:
            start, end = ends[row].tolist()
            color = (*colors[row], 255)
            canvas.line((*start, *end), color, round(_FINER * _FRUSTUM_PX))


def _projected(
    points: Float64Array, view: View, size: tuple[int, int]
) -> tuple[Float64Array, Float64Array]:
    """(N, 2) pixels and (N,) depths."""
    forward = view.target - view.eye
    forward = forward / np.linalg.norm(forward)
    axes = np.stack([np.cross(forward, view.up), -view.up, forward])
    seen = (points - view.eye) @ axes.T
    focal = size[1] / 2 / np.tan(np.radians(VERTICAL_FIELD_OF_VIEW_DEG) / 2)
    depths = seen[:, 2]
    safe = np.where(depths > 0, depths, np.inf)[:, None]
    pixels: Float64Array = focal * seen[:, :2] / safe + np.array(size) / 2
    return pixels, depths
