"""Where models stand in the scene: of a handy size, up upwards, those without a common frame apart.

Whatever a model's units are, the largest one is about ``EXTENT`` wide in the scene. It stays where
it is while it grows and moves, until that no longer fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sfm_front.live_page.model_shapes import ModelShape
from sfm_front.types import Float64Array
from sfm_front.viewers.viewpoint import upward

EXTENT = 10.0
"""Diagonal of the largest model in the scene."""

_MIDDLE_PERCENTILES = (2.0, 98.0)
# More than enough to tell the extent.
_MOST_POINTS = 20_000
# A placement is kept while the model in it is at most so many times larger or smaller, off by so
# many extents, and tilted by so much.
_KEPT_GROWTH = 1.6
_KEPT_OFFSET = 0.35
_KEPT_TILT_COSINE = np.cos(np.radians(8.0))
# Models beside the largest one: their size by their share of photos, and the gap between them.
_LEAST_SHARE, _MOST_SHARE = 0.3, 0.7
_GAP = 0.12 * EXTENT
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """``scene = scale * rotation @ model + offset``."""

    scale: float
    rotation: Float64Array
    offset: Float64Array

    def points(self, xyz: Float64Array) -> Float64Array:
        """(N, 3) of the model → of the scene."""
        moved: Float64Array = self.scale * xyz @ self.rotation.T + self.offset
        return moved

    def rotations(self, world_from_cam: Float64Array) -> Float64Array:
        """(N, 3, 3), the same of cameras."""
        turned: Float64Array = self.rotation @ world_from_cam
        return turned


class Arrangement:
    """Places models, again and again."""

    def __init__(self) -> None:
        self._main: Placement | None = None
        # Of which model, in which frame, it is.
        self._frame: tuple[int, bool] | None = None

    def place(self, shapes: Sequence[ModelShape]) -> list[Placement]:
        """One placement for each, the largest model first."""
        if not shapes:
            return []
        main = shapes[0]
        frame = main.model_id, main.is_enu
        if self._main is None or frame != self._frame or not _fits(main, self._main):
            self._main, self._frame = _centred(main, EXTENT), frame
        placements = [self._main]
        low, high = _box(self._main.points(_sample(main)))
        right, floor = high[0] + _GAP, low[2]
        for shape in shapes[1:]:
            if main.is_enu and shape.is_enu:
                placements.append(self._main)
                continue
            share = np.sqrt(len(shape.image_ids) / len(main.image_ids))
            own = _centred(shape, EXTENT * float(np.clip(share, _LEAST_SHARE, _MOST_SHARE)))
            low, high = _box(own.points(_sample(shape)))
            shift = np.array([right - low[0], 0.0, floor - low[2]])
            placements.append(Placement(own.scale, own.rotation, own.offset + shift))
            right += high[0] - low[0] + _GAP
        return placements


def up_of(shape: ModelShape) -> Float64Array:
    """(3,) upwards in a model's world."""
    return _UP if shape.is_enu else upward(shape.rotations, shape.centres)


def _sample(shape: ModelShape) -> Float64Array:
    step = max(len(shape.points) // _MOST_POINTS, 1)
    return np.concatenate([shape.points[::step], shape.centres])


def _box(points: Float64Array) -> tuple[Float64Array, Float64Array]:
    low, high = np.percentile(points, _MIDDLE_PERCENTILES, axis=0)
    return low, high


def _centred(shape: ModelShape, extent: float) -> Placement:
    rotation = _turning_up(up_of(shape))
    low, high = _box(_sample(shape) @ rotation.T)
    scale = extent / max(float(np.linalg.norm(high - low)), 1e-9)
    return Placement(scale, rotation, -scale * (low + high) / 2)


def _fits(shape: ModelShape, placement: Placement) -> bool:
    low, high = _box(placement.points(_sample(shape)))
    growth = float(np.linalg.norm(high - low)) / EXTENT
    offset = float(np.linalg.norm(low + high)) / 2 / EXTENT
    upright = float(_UP @ placement.rotation @ up_of(shape))
    return (
        1 / _KEPT_GROWTH < growth < _KEPT_GROWTH
        and offset < _KEPT_OFFSET
        and upright > _KEPT_TILT_COSINE
    )


def _turning_up(up: Float64Array) -> Float64Array:
    """The smallest rotation that turns ``up`` to the scene's."""
    axis = np.cross(up, _UP)
    cosine = float(up @ _UP)
    if cosine < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation: Float64Array = np.eye(3) + skew + skew @ skew / (1 + cosine)
    return rotation
