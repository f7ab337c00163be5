"""COLMAP's perspective camera models as a ladder: each holds those below it exactly."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pycolmap

LADDER = ("SIMPLE_RADIAL", "RADIAL", "OPENCV")
"""The lenses that a camera may grow through, the simplest first."""

# Where the params of a model stand among OPENCV's fx, fy, cx, cy, k1, k2, p1, p2.
_IN_OPENCV = {
    "SIMPLE_PINHOLE": (0, 2, 3),
    "PINHOLE": (0, 1, 2, 3),
    "SIMPLE_RADIAL": (0, 2, 3, 4),
    "RADIAL": (0, 2, 3, 4, 5),
    "OPENCV": (0, 1, 2, 3, 4, 5, 6, 7),
}
# Radii from the middle to the corner at which a lens is looked at.
_RADII = 33


def as_opencv(camera: pycolmap.Camera) -> pycolmap.Camera | None:
    """The same camera as one of OPENCV's model; None if that cannot be."""
    places = _IN_OPENCV.get(camera.model_name)
    if places is None:
        return None
    params = np.zeros(8)
    params[list(places)] = camera.params
    if 1 not in places:
        params[1] = params[0]
    return _with(camera, "OPENCV", params.tolist())


def grown(camera: pycolmap.Camera, model: str) -> pycolmap.Camera:
    """The same camera as one of a model of ``LADDER`` that is not below its own."""
    opencv = as_opencv(camera)
    assert opencv is not None
    return _with(camera, model, opencv.params[list(_IN_OPENCV[model])].tolist())


def simplified(camera: pycolmap.Camera, model: str) -> pycolmap.Camera:
    """The camera of a lower rung, SIMPLE_RADIAL or RADIAL, that is nearest to it over the photo by
    least squares; the principal point stays."""
    x, y = ((np.arange(_RADII) + 0.5) / _RADII * side for side in (camera.width, camera.height))
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    rays = np.asarray(camera.cam_from_img(pixels), np.float64)
    axis = np.array([camera.principal_point_x, camera.principal_point_y])
    squared = (rays**2).sum(axis=1)
    num_terms = LADDER.index(model) + 2
    columns = [(rays * squared[:, None] ** power).ravel() for power in range(num_terms)]
    terms = np.linalg.lstsq(np.stack(columns, axis=1), (pixels - axis).ravel(), rcond=None)[0]
    params = [terms[0], *axis, *(terms[1:] / terms[0])]
    return _with(camera, model, [float(value) for value in params])


def take_intrinsics(camera: pycolmap.Camera, other: pycolmap.Camera) -> None:
    """Make a camera of a model what another one is; id, size and prior stay."""
    camera.model = other.model
    camera.params = other.params.tolist()


def is_one_to_one(camera: pycolmap.Camera) -> bool:
    """Whether what lies farther from the axis is farther out in the photo, as far as its corners:
    a distortion that is not borne out there folds back."""
    pixel_corners = np.array(
        [[x, y] for x in (0.0, camera.width) for y in (0.0, camera.height)], np.float64
    )
    axis = np.array([camera.principal_point_x, camera.principal_point_y])
    focal = np.array([camera.focal_length_x, camera.focal_length_y])
    towards = (pixel_corners - axis) / focal
    out = np.linspace(0, 1, _RADII)[:, None, None] * towards
    rays = np.concatenate([out, np.ones((*out.shape[:2], 1))], axis=2).reshape(-1, 3)
    pixels = np.asarray(camera.img_from_cam(rays)).reshape(_RADII, -1, 2)
    radii = np.linalg.norm(pixels - axis, axis=2)
    return bool(np.all(np.diff(radii, axis=0) > 0))


def _with(camera: pycolmap.Camera, model: str, params: list[float]) -> pycolmap.Camera:
    import pycolmap

    changed = copy.copy(camera)
    changed.model = getattr(pycolmap.CameraModelId, model)
    changed.params = params
    return changed
