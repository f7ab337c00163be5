"""How far a refinement has moved the cameras of a model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pycolmap

from sfm_front.types import Float64Array


def camera_centers(model: pycolmap.Reconstruction) -> dict[int, Float64Array]:
    """(3,) projection centres in world coordinates by image id."""
    return {i: model.image(i).projection_center() for i in model.reg_image_ids()}


def camera_motion(
    before: Mapping[int, Float64Array], after: Mapping[int, Float64Array]
) -> tuple[float, float]:
    """Median and largest distance between the places of the photos that are in both."""
    both = [image_id for image_id in before if image_id in after]
    if not both:
        return 0.0, 0.0
    moved = [float(np.linalg.norm(after[i] - before[i])) for i in both]
    return float(np.median(moved)), max(moved)
