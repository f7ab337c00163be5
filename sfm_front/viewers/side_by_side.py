"""Models that have no frame in common, next to each other: upright, on one floor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sfm_front.types import Float64Array
from sfm_front.viewers.viewpoint import upward

if TYPE_CHECKING:
    import pycolmap

UP = np.array([0.0, 0.0, 1.0])
"""In east, north and up, and wherever models stand side by side."""

_MIDDLE_PERCENTILES = (2.0, 98.0)
# Of the first model's diagonal.
_GAP = 0.1
# A model with few photos is drawn smaller than the first one, but not so that nothing is seen.
_LEAST_SIZE = 0.3


def up_of(model: pycolmap.Reconstruction) -> Float64Array:
    """(3,) upwards in a model's world, as its cameras tell. It has photos."""
    poses = [model.images[i].cam_from_world().inverse() for i in model.reg_image_ids()]
    rotations = np.array([pose.rotation.matrix() for pose in poses])
    return upward(rotations, np.array([pose.translation for pose in poses]))


def place_side_by_side(models: Sequence[pycolmap.Reconstruction]) -> None:
    """Move the models themselves: the first keeps its size, others have one by their share of
    photos."""
    import pycolmap

    first_size, right, floor = 0.0, 0.0, 0.0
    for number, model in enumerate(models):
        model.transform(
            pycolmap.Sim3d(1.0, pycolmap.Rotation3d(_turning_up(up_of(model))), np.zeros(3))
        )
        low, high = _box(model)
        size = max(float(np.linalg.norm(high - low)), 1e-12)
        if not number:
            first_size, right, floor = size, float(high[0]), float(low[2])
            continue
        share = np.sqrt(model.num_reg_images() / models[0].num_reg_images())
        scale = float(np.clip(share, _LEAST_SIZE, 1.0)) * first_size / size
        shift = np.array([right + _GAP * first_size, 0.0, floor]) - scale * np.array(
            [low[0], (low[1] + high[1]) / 2, low[2]]
        )
        model.transform(pycolmap.Sim3d(scale, pycolmap.Rotation3d(), shift))
        right += _GAP * first_size + scale * float(high[0] - low[0])


def _box(model: pycolmap.Reconstruction) -> tuple[Float64Array, Float64Array]:
    """Of the middle of its points, and all its cameras."""
    centres = np.array([model.images[i].projection_center() for i in model.reg_image_ids()])
    points = np.array([point.xyz for point in model.points3D.values()]).reshape(-1, 3)
    if not len(points):
        return centres.min(axis=0), centres.max(axis=0)
    low, high = np.percentile(points, _MIDDLE_PERCENTILES, axis=0)
    return np.minimum(low, centres.min(axis=0)), np.maximum(high, centres.max(axis=0))


def _turning_up(up: Float64Array) -> Float64Array:
    """(3, 3): the smallest rotation that turns ``up`` to ``UP``."""
    axis, cosine = np.cross(up, UP), float(up @ UP)
    if cosine < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation: Float64Array = np.eye(3) + cross + cross @ cross / (1 + cosine)
    return rotation
