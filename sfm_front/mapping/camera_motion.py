"""How far a refinement has moved the cameras of a model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pycolmap

from sfm_front.types import Float64Array

# Fewer do not tell a similarity.
_MIN_CAMERAS = 3


def camera_centers(model: pycolmap.Reconstruction) -> dict[int, Float64Array]:
    """(3,) projection centres in world coordinates by image id."""
    return {i: model.image(i).projection_center() for i in model.reg_image_ids()}


def camera_motion(
    before: Mapping[int, Float64Array], after: Mapping[int, Float64Array]
) -> tuple[float, float]:
    """Median and largest distance between the places of the photos that are in both, in units of
    the model before; 0 for fewer than three.

    COLMAP moves and scales a model as a whole when it refines it: that is no motion, and the
    similarity that fits best is taken out.
    """
    both = [image_id for image_id in before if image_id in after]
    if len(both) < _MIN_CAMERAS:
        return 0.0, 0.0
    old, new = (np.array([centers[i] for i in both]) for centers in (before, after))
    before_from_after = pycolmap.estimate_sim3d(new, old)
    # None if they all lie in one place or on one line.
    aligned = new if before_from_after is None else _transformed(before_from_after, new)
    moved = np.linalg.norm(aligned - old, axis=1)
    return float(np.median(moved)), float(moved.max())


def _transformed(by: pycolmap.Sim3d, points: Float64Array) -> Float64Array:
    matrix = np.asarray(by.matrix())
    moved: Float64Array = points @ matrix[:, :3].T + matrix[:, 3]
    return moved
