"""The models in ``sparse/`` as arrays to draw, read while a session replaces them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.errors import InputError
from sfm_front.georeference.sidecar import FILE_NAME, read_sidecar
from sfm_front.storage.colmap_models import find_models, read_model
from sfm_front.storage.written_models import STATE, damaged_file, read_state
from sfm_front.types import Float64Array, Uint8Array

# Points outside the middle 98 % by more than this many diagonals of their box are not drawn.
_KEPT_DIAGONALS = 1.0
_MIDDLE_PERCENTILES = (1.0, 99.0)


@dataclass(frozen=True, slots=True, eq=False)
class ModelShape:
    """A model in its own world coordinates; K photos, N points.

    ``model_id``: the session's, or the number of its folder. ``image_ids`` (K,), ``names`` in the
    same order. ``centres`` (K, 3), ``rotations`` (K, 3, 3) from camera to world; ``sizes`` (K, 3)
    of frusta: half width, half height and depth, with a diagonal of 1 at the base.
    ``num_observed`` (K,): points that a photo sees. ``points`` (N, 3), ``colors`` (N, 3) uint8,
    without far outliers. ``num_points``: all of them. ``is_enu``: in metres east, north and up.
    """

    model_id: int
    image_ids: NDArray[np.int64]
    names: Sequence[str]
    centres: Float64Array
    rotations: Float64Array
    sizes: Float64Array
    num_observed: NDArray[np.int64]
    points: Float64Array
    colors: Uint8Array
    num_points: int
    is_enu: bool


@dataclass(frozen=True, slots=True, eq=False)
class Models:
    """All models of one moment, the one of most photos first; ``written``: seconds since 1970."""

    shapes: Sequence[ModelShape]
    written: float


class ModelReader:
    """Reads the models of an output, or a single one, whenever they have changed."""

    def __init__(self, folder: Path) -> None:
        """``folder`` holds models, or is one."""
        self._folder = folder
        self._seen: tuple[int, ...] | None = None

    def new(self) -> Models | None:
        """The models, if they are others than at the last look and are whole; else None."""
        version = self._version()
        if version is None or version == self._seen:
            return None
        try:
            content = read_state(self._folder)
            if damaged_file(self._folder, content.get("files", {})) is not None:
                return None
            in_enu = _in_enu(self._folder)
            shapes = [
                _shape(read_model(folder), model_id, number in in_enu)
                for number, (folder, model_id) in enumerate(_folders(self._folder, content))
            ]
        except (InputError, OSError, ValueError, KeyError, TypeError, AttributeError):
            # Replaced meanwhile, most likely: there will be another look.
            return None
        if self._version() != version:
            return None
        self._seen = version
        shapes = [shape for shape in shapes if len(shape.image_ids)]
        shapes.sort(key=lambda shape: -len(shape.image_ids))
        return Models(shapes, written=max(version) / 1e9)

    def _version(self) -> tuple[int, ...] | None:
        """When its files were written, in nanoseconds since 1970; None if there are none."""
        state = self._folder / STATE
        try:
            if state.exists():
                return (state.stat().st_mtime_ns,)
            # Models of another program.
            files = [file for model in find_models(self._folder) for file in model.glob("*")]
            return tuple(sorted(file.stat().st_mtime_ns for file in files)) or None
        except OSError:
            return None


def _folders(folder: Path, content: dict[str, Any]) -> list[tuple[Path, int]]:
    """Each model's folder and id."""
    if "models" in content:
        ids = [int(model["model_id"]) for model in content["models"]]
        return [(folder / str(number), model_id) for number, model_id in enumerate(ids)]
    return [(found, number) for number, found in enumerate(find_models(folder))]


def _in_enu(folder: Path) -> Sequence[int]:
    """Numbers of the models in metres east, north and up."""
    for place in (folder, folder.absolute().parent):
        if (place / FILE_NAME).is_file():
            numbers = read_sidecar(place / FILE_NAME).models_in_enu
            if place != folder:  # A single model of an output.
                return [0] if folder.name in map(str, numbers) else []
            return numbers
    return ()


def _shape(model: pycolmap.Reconstruction, model_id: int, is_enu: bool) -> ModelShape:
    images = [model.images[image_id] for image_id in sorted(model.reg_image_ids())]
    poses = [image.cam_from_world().inverse() for image in images]
    cameras = [model.cameras[image.camera_id] for image in images]
    centres = np.array([pose.translation for pose in poses]).reshape(-1, 3)
    points, colors = _points(model, centres)
    return ModelShape(
        model_id=model_id,
        image_ids=np.array([image.image_id for image in images], np.int64),
        names=[image.name for image in images],
        centres=centres,
        rotations=np.array([pose.rotation.matrix() for pose in poses]).reshape(-1, 3, 3),
        sizes=np.array([frustum_size_of(camera) for camera in cameras]).reshape(-1, 3),
        num_observed=np.array([image.num_points3D for image in images], np.int64),
        points=points,
        colors=colors,
        num_points=int(model.num_points3D()),
        is_enu=is_enu,
    )


def frustum_size_of(camera: pycolmap.Camera) -> Float64Array:
    """(3,) half width, half height and depth, as ``ModelShape.sizes``."""
    size = np.array([camera.width / 2, camera.height / 2, camera.mean_focal_length()])
    scaled: Float64Array = size / np.hypot(camera.width, camera.height)
    return scaled


def _points(
    model: pycolmap.Reconstruction, centres: Float64Array
) -> tuple[Float64Array, Uint8Array]:
    seen = model.points3D.values()
    points = np.array([point.xyz for point in seen], np.float64).reshape(-1, 3)
    colors = np.array([point.color for point in seen], np.uint8).reshape(-1, 3)
    if not len(points) or not len(centres):
        return points, colors
    low, high = np.percentile(points, _MIDDLE_PERCENTILES, axis=0)
    margin = _KEPT_DIAGONALS * np.linalg.norm(high - low)
    low = np.minimum(low, centres.min(axis=0)) - margin
    high = np.maximum(high, centres.max(axis=0)) + margin
    kept = np.all((points >= low) & (points <= high), axis=1)
    return points[kept], colors[kept]
