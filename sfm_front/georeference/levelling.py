"""Photographers and gimbals hold cameras level: what that says of which way is up."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from sfm_front.geometry.similarity import Similarities
from sfm_front.types import Float64Array

# By how much cameras are out of level on the mean. All photos of a model count as one observation:
# whoever holds a camera aslant does so again.
_LEVEL_SIGMA = np.radians(3.0)
# Sine of the roll (root mean square over the photos) above which nobody held them level.
_MAX_ROLL = 0.2
# Turns that are tried; the adjustment does the rest.
_ANGLES = np.radians(np.arange(0.0, 360.0, 2.0))
# Weight of the right way up against level: decides where level leaves two ways, or all.
_UPRIGHT_WEIGHT = 1e-3
# As a squared number of standard deviations: photos are not taken upside down.
_UPSIDE_DOWN_COST = 9.0
# Cameras that are turned this far against each other, and roll no more than that against one plane,
# show where the horizon is: sines.
_MIN_TURN = 0.3
_MAX_ROLL_TO_HORIZON = 0.12
# Cameras that are looked at.
_MAX_CAMERAS = 200


class LevelRows(NamedTuple):
    """Linearised observations that cameras are level: by the rotation vector (N, 3) in ENU, and
    what is left (N,); in standard deviations."""

    by_rotation: Float64Array
    residuals: Float64Array


class LevelCameras:
    """What is known of the attitude of a model's cameras."""

    def __init__(self, cam_from_model: Float64Array) -> None:
        """``cam_from_model`` (N, 3, 3): rotations of the cameras as they were held: x right, y
        down, z forward."""
        some = cam_from_model[:: -(-len(cam_from_model) // _MAX_CAMERAS)]
        self._rights = some[:, 0]
        # The upper edge of a photo that is taken ahead, and the way up of one that looks down.
        self._ups = -(some[:, 1] + some[:, 2]).mean(axis=0)
        self.up = self._up()
        """(3,) in the model, where the cameras show where the horizon is; else None."""

    def turned_upright(self, similarity: Similarities, centres: Float64Array) -> Similarities:
        """The similarity, followed by the turn about the line through the camera centres (N, 3)
        that makes cameras level and the right way up."""
        moved = similarity(centres)[0]
        pivot = moved.mean(axis=0)
        line = np.linalg.svd(moved - pivot, full_matrices=False)[2][0]
        rights = _height_when_turned(self._rights @ similarity.rotations[0].T, line)
        ups = _height_when_turned(self._ups[None] @ similarity.rotations[0].T, line)
        cost = (rights**2).mean(axis=0) - _UPRIGHT_WEIGHT * ups[0]
        turn = cv2.Rodrigues(line * _ANGLES[int(cost.argmin())])[0]
        return Similarities(
            similarity.scales,
            turn @ similarity.rotations,
            pivot + (similarity.translations - pivot) @ turn.T,
        )

    def are_level(self, similarity: Similarities) -> bool:
        """Whether anybody held them level."""
        rolls = similarity.rotations[0, 2] @ self._rights.T
        return float(np.sqrt(np.mean(rolls**2))) <= _MAX_ROLL

    def rows(self, similarity: Similarities) -> LevelRows:
        """Observations for an adjustment of enu_from_model."""
        rights = self._rights @ similarity.rotations[0].T
        # How the height of their ends changes: up · (ω × right) = ω · (right × up).
        by_rotation = np.column_stack([rights[:, 1], -rights[:, 0], np.zeros(len(rights))])
        sigma = _LEVEL_SIGMA * np.sqrt(len(rights))
        return LevelRows(by_rotation / sigma, -rights[:, 2] / sigma)

    def costs(self, similarities: Similarities) -> Float64Array:
        """(H,) squared standard deviations by which the cameras are not level and upright.

        That they do not agree on a horizon does not speak for any of them more than so much.
        """
        ways_up = similarities.rotations[:, 2]
        costs = np.mean((ways_up @ self._rights.T / _LEVEL_SIGMA) ** 2, axis=1)
        if self.up is None:
            costs = np.minimum(costs, (_MAX_ROLL / _LEVEL_SIGMA) ** 2)
        upright: Float64Array = costs + _UPSIDE_DOWN_COST * (ways_up @ self._ups < 0)
        return upright

    def _up(self) -> Float64Array | None:
        squares, axes = np.linalg.eigh(self._rights.T @ self._rights / len(self._rights))
        if squares[0] > _MAX_ROLL_TO_HORIZON**2 or squares[1] < _MIN_TURN**2:
            return None
        up: Float64Array = axes[:, 0] * np.sign(axes[:, 0] @ self._ups)
        return up


def _height_when_turned(vectors: Float64Array, line: Float64Array) -> Float64Array:
    """(N, A) the upward part of vectors (N, 3), turned about a line by each of the angles."""
    along = vectors @ line * line[2]
    across = np.cross(line, vectors)[:, 2]
    height: Float64Array = (
        along[:, None]
        + np.outer(vectors[:, 2] - along, np.cos(_ANGLES))
        + np.outer(across, np.sin(_ANGLES))
    )
    return height
