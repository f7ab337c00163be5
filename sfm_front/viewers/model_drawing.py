"""A COLMAP model → what is drawn: coloured points, camera frusta, a view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import InputError
from sfm_front.types import Float64Array
from sfm_front.viewers.options import BACKGROUNDS, DrawOptions
from sfm_front.viewers.viewpoint import View, choose_view

if TYPE_CHECKING:
    import pycolmap

#: Points farther outside the middle 98 % than this, in diagonals of their box, are not drawn.
_KEPT_EXTENTS = 1.0
_MIDDLE_PERCENTILES = (1.0, 99.0)

#: Diagonal of a frustum's base: this fraction of the distance to the nearest camera, within these
#: fractions of the scene's diagonal.
_FRUSTUM_PER_GAP = 0.6
_FRUSTUM_PER_DIAGONAL = (0.01, 0.035)

#: First photo to last: blue, teal, yellow, red; visible on dark and on white.
_SEQUENCE_COLORS = np.array(
    [[0.20, 0.47, 0.96], [0.06, 0.72, 0.65], [0.95, 0.70, 0.10], [0.93, 0.25, 0.22]]
)

#: A frustum's edges between its five vertices: apex, then corners clockwise from the top left.
FRUSTUM_LINES = np.array(
    [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]], dtype=np.int32
)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What is drawn, in world coordinates; colours are RGB in [0, 1].

    ``points`` and ``point_colors`` are (N, 3) float64. The frusta of K cameras, in the order of
    their photos: ``vertices`` (5 K, 3) float64, ``lines`` (8 K, 2) int32 indices into them,
    ``line_colors`` (8 K, 3) float64.
    """

    points: Float64Array
    point_colors: Float64Array
    vertices: Float64Array
    lines: NDArray[np.int32]
    line_colors: Float64Array
    point_size_px: float
    view: View


def build_scene(model: pycolmap.Reconstruction, options: DrawOptions | None = None) -> Scene:
    """Everything a viewer needs of ``model``.

    Raises ``InputError`` if no photo of the model has a pose.
    """
    options = options or DrawOptions()
    images = [model.images[image_id] for image_id in sorted(model.reg_image_ids())]
    if not images:
        raise InputError("the model holds no registered photo: there is nothing to draw")
    world_from_cam = [image.cam_from_world().inverse() for image in images]
    rotations = np.array([pose.rotation.matrix() for pose in world_from_cam])
    centres = np.array([pose.translation for pose in world_from_cam])

    points, colors = _points(model, centres, BACKGROUNDS[options.background][1])
    size = frustum_size(points, centres)
    vertices = np.concatenate(
        [
            centre + size * frustum(model.cameras[image.camera_id]) @ rotation.T
            for image, rotation, centre in zip(images, rotations, centres, strict=True)
        ]
    )
    firsts = 5 * np.arange(len(images), dtype=np.int32)
    return Scene(
        points=points,
        point_colors=colors,
        vertices=vertices,
        lines=(firsts[:, None, None] + FRUSTUM_LINES).reshape(-1, 2),
        line_colors=np.repeat(sequence_colors(len(images)), len(FRUSTUM_LINES), axis=0),
        point_size_px=options.point_size_px or _point_size(len(points), options),
        view=choose_view(points, vertices, rotations, centres, options.width / options.height),
    )


def sequence_colors(count: int) -> Float64Array:
    """(count, 3) float64: one colour per photo, running through the sequence."""
    stops = np.linspace(0.0, 1.0, len(_SEQUENCE_COLORS))
    at = np.linspace(0.0, 1.0, count)
    return np.stack([np.interp(at, stops, channel) for channel in _SEQUENCE_COLORS.T], axis=1)


def _points(
    model: pycolmap.Reconstruction, centres: Float64Array, grey: float
) -> tuple[Float64Array, Float64Array]:
    """Coordinates and colours without far outliers; ``grey`` if the model has no colours."""
    seen = [point for _, point in sorted(model.points3D.items())]
    points = np.array([point.xyz for point in seen]).reshape(-1, 3)
    colors = np.array([point.color for point in seen]).reshape(-1, 3) / 255.0
    if not len(points):
        return points, colors
    low, high = np.percentile(points, _MIDDLE_PERCENTILES, axis=0)
    margin = _KEPT_EXTENTS * np.linalg.norm(high - low)
    low = np.minimum(low, centres.min(axis=0)) - margin
    high = np.maximum(high, centres.max(axis=0)) + margin
    kept = np.all((points >= low) & (points <= high), axis=1)
    if not colors.any():
        colors = np.full_like(points, grey)
    return points[kept], colors[kept]


def frustum(camera: pycolmap.Camera) -> Float64Array:
    """(5, 3) in camera coordinates; its base has diagonal 1 at any focal length.

    Distortion and an off-centre principal point are not drawn.
    """
    diagonal = float(np.hypot(camera.width, camera.height))
    x, y = 0.5 * camera.width / diagonal, 0.5 * camera.height / diagonal
    z = camera.mean_focal_length() / diagonal
    return np.array([[0, 0, 0], [-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]])


def frustum_size(points: Float64Array, centres: Float64Array) -> float:
    """Small compared to the scene, and such that neighbours in a sequence do not overlap."""
    everything = np.concatenate([points, centres])
    low, high = np.percentile(everything, _MIDDLE_PERCENTILES, axis=0)
    diagonal = float(np.linalg.norm(high - low)) or 1.0
    smallest, largest = (part * diagonal for part in _FRUSTUM_PER_DIAGONAL)
    if len(centres) < 2:
        return largest
    gaps = [np.partition(np.linalg.norm(centres - centre, axis=1), 1)[1] for centre in centres]
    return float(np.clip(_FRUSTUM_PER_GAP * np.median(gaps), smallest, largest))


def _point_size(count: int, options: DrawOptions) -> float:
    """Larger points for sparser clouds, so that scenes look equally dense at any size."""
    area_per_point = options.width * options.height / max(count, 1)
    size = np.clip(0.3 * np.sqrt(area_per_point), 2.0, 6.0) * options.height / 1000
    return max(float(size), 1.5)
