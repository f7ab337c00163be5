"""COLMAP models → what is drawn: coloured points, cameras and their path, a view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import InputError
from sfm_front.types import Float64Array
from sfm_front.viewers.options import BACKGROUNDS, DrawOptions
from sfm_front.viewers.point_colors import point_colors, sequence_colors
from sfm_front.viewers.viewpoint import View, choose_view, upward

if TYPE_CHECKING:
    import pycolmap

#: Points farther outside the middle 98 % than this, in diagonals of their box, are not drawn.
_KEPT_EXTENTS = 1.0
_MIDDLE_PERCENTILES = (1.0, 99.0)

#: Diagonal of a frustum's base: this fraction of the distance to the nearest camera, within these
#: fractions of the scene's diagonal.
_FRUSTUM_PER_GAP = 0.6
_FRUSTUM_PER_DIAGONAL = (0.01, 0.035)

#: A frustum's edges between its five vertices: apex, then corners clockwise from the top left.
FRUSTUM_LINES = np.array(
    [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]], dtype=np.int32
)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What is drawn, in world coordinates; colours are RGB in [0, 1].

    ``points`` and ``point_colors`` are (N, 3) float64. Frusta of K cameras, in the order of their
    photos, and what leads from one to the next: ``vertices`` (V, 3) float64, of which the first 5 K
    are the frusta's, five each; ``lines`` (L, 2) int32 indices into them, ``line_colors`` (L, 3)
    float64. ``legends``: what colours of points say, for each model where that is a quantity.
    """

    points: Float64Array
    point_colors: Float64Array
    vertices: Float64Array
    lines: NDArray[np.int32]
    line_colors: Float64Array
    point_size_px: float
    view: View
    legends: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """One model's share of a scene, and its cameras: ``rotations`` (K, 3, 3), world from camera,
    and ``centres`` (K, 3)."""

    points: Float64Array
    point_colors: Float64Array
    frusta: Float64Array
    rotations: Float64Array
    centres: Float64Array
    legend: str


def build_scene(
    models: pycolmap.Reconstruction | Sequence[pycolmap.Reconstruction],
    options: DrawOptions | None = None,
    up: Float64Array | None = None,
) -> Scene:
    """Everything a viewer needs of a model, or of several in one frame.

    ``up`` (3,): upwards in their world, length 1; by default as the cameras tell. Raises
    ``InputError`` if no photo of a model has a pose.
    """
    options = options or DrawOptions()
    parts = [
        _part(model, options, up)
        for model in (models if isinstance(models, Sequence) else [models])
    ]
    points = np.concatenate([part.points for part in parts])
    corners = np.concatenate([part.frusta for part in parts])
    vertices, lines, line_colors = _drawn_lines(parts, options)
    return Scene(
        points=points,
        point_colors=np.concatenate([part.point_colors for part in parts]),
        vertices=vertices,
        lines=lines,
        line_colors=line_colors,
        point_size_px=options.point_size_px or _point_size(len(points), options),
        view=choose_view(
            points,
            corners,
            np.concatenate([part.rotations for part in parts]),
            np.concatenate([part.centres for part in parts]),
            options.width / options.height,
            up=up,
        ),
        legends=tuple(part.legend for part in parts if part.legend),
    )


def _part(model: pycolmap.Reconstruction, options: DrawOptions, up: Float64Array | None) -> _Part:
    image_ids = sorted(model.reg_image_ids())
    images = [model.images[image_id] for image_id in image_ids]
    if not images:
        raise InputError("the model holds no registered photo: there is nothing to draw")
    world_from_cam = [image.cam_from_world().inverse() for image in images]
    rotations = np.array([pose.rotation.matrix() for pose in world_from_cam])
    centres = np.array([pose.translation for pose in world_from_cam])
    seen = _near_points(model, centres)
    colors, legend = point_colors(
        seen,
        image_ids,
        options.coloring,
        upward(rotations, centres) if up is None else up,
        BACKGROUNDS[options.background][1],
    )
    points = np.array([point.xyz for point in seen]).reshape(-1, 3)
    size = frustum_size(points, centres)
    corners = [
        centre + size * frustum(model.cameras[image.camera_id]) @ rotation.T
        for image, rotation, centre in zip(images, rotations, centres, strict=True)
    ]
    return _Part(points, colors, np.concatenate(corners), rotations, centres, legend)


def _drawn_lines(
    parts: Sequence[_Part], options: DrawOptions
) -> tuple[Float64Array, NDArray[np.int32], Float64Array]:
    """Vertices, lines and their colours, as a scene has them."""
    vertices = np.concatenate([part.frusta for part in parts])
    lines, colors = [np.zeros((0, 2), np.int32)], [np.zeros((0, 3))]
    first = 0
    for part in parts:
        count = len(part.centres)
        apexes = first + 5 * np.arange(count, dtype=np.int32)
        of_photo = sequence_colors(count)
        if options.frusta:
            lines.append((apexes[:, None, None] + FRUSTUM_LINES).reshape(-1, 2))
            colors.append(np.repeat(of_photo, len(FRUSTUM_LINES), axis=0))
        if options.path:
            lines.append(np.stack([apexes[:-1], apexes[1:]], axis=1))
            colors.append(of_photo[:-1])
        first += 5 * count
    return vertices, np.concatenate(lines), np.concatenate(colors)


def _near_points(model: pycolmap.Reconstruction, centres: Float64Array) -> list[pycolmap.Point3D]:
    """Without far outliers."""
    seen = [point for _, point in sorted(model.points3D.items())]
    if not seen:
        return seen
    points = np.array([point.xyz for point in seen])
    low, high = np.percentile(points, _MIDDLE_PERCENTILES, axis=0)
    margin = _KEPT_EXTENTS * np.linalg.norm(high - low)
    low = np.minimum(low, centres.min(axis=0)) - margin
    high = np.maximum(high, centres.max(axis=0)) + margin
    kept = np.all((points >= low) & (points <= high), axis=1)
    return [point for point, is_kept in zip(seen, kept, strict=True) if is_kept]


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
