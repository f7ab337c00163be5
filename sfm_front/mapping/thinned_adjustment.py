"""Adjusts a large model by some of its points, and then the others to where its photos stand.

An adjustment takes about a kilobyte for each observation, and photos of thousands of features are
placed as well by a few hundred: what is left of their error is that of the whole model, which no
number of neighbouring points takes away.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection

import numpy as np
import pycolmap

from sfm_front.mapping.taking_over import take_over

HUGE = 1000
"""Photos from which a model is adjusted by some of its points."""

# Of those, the points that each photo keeps (TUNING: thinned).
_POINTS_PER_PHOTO = 200
# Reprojection error of an observation from which a point that was adjusted by itself has no place.
_LOST_PX = 50.0
# Points that are adjusted at a time, each by itself: so many take little memory.
_AT_A_TIME = 50_000


def adjust_thinned(
    reconstruction: pycolmap.Reconstruction,
    adjustment: pycolmap.BundleAdjustmentOptions,
    adjust: Callable[[pycolmap.Reconstruction], None],
) -> None:
    """Have ``adjust`` adjust the model, or a copy with some of its points if it is large, whose
    poses, cameras and points are taken over; ``adjustment`` is for the other points then."""
    if reconstruction.num_reg_images() < HUGE:
        adjust(reconstruction)
        return
    chosen = chosen_points(reconstruction, _POINTS_PER_PHOTO)
    others = sorted(set(reconstruction.point3D_ids()) - chosen)
    thinned = copy.deepcopy(reconstruction)
    for point_id in others:
        thinned.delete_point3D(point_id)
    adjust(thinned)
    take_over(reconstruction, thinned)
    del thinned
    for start in range(0, len(others), _AT_A_TIME):
        _adjust_points(reconstruction, others[start : start + _AT_A_TIME], adjustment)
    # From where they were before the photos moved, some do not find back.
    pycolmap.ObservationManager(reconstruction).filter_points3D(_LOST_PX, 0.0, set(others))


def chosen_points(reconstruction: pycolmap.Reconstruction, per_photo: int) -> set[int]:
    """Ids of some points, so that each registered photo sees ``per_photo`` of them, or all that it
    sees; the same each time.

    Photo by photo those are added, drawn at random, that it lacks: points that many photos see
    serve them all.
    """
    rng = np.random.default_rng(0)
    chosen: set[int] = set()
    for image_id in sorted(reconstruction.reg_image_ids()):
        seen = {
            point.point3D_id for point in reconstruction.image(image_id).get_observation_points2D()
        }
        left = sorted(seen - chosen)
        num_lacking = per_photo - (len(seen) - len(left))
        if num_lacking >= len(left):
            chosen.update(left)
        elif num_lacking > 0:
            chosen.update(rng.choice(left, num_lacking, replace=False).tolist())
    return chosen


def _adjust_points(
    reconstruction: pycolmap.Reconstruction,
    point_ids: Collection[int],
    adjustment: pycolmap.BundleAdjustmentOptions,
) -> None:
    """Photos that are not in the adjustment stay, as do their cameras."""
    config = pycolmap.BundleAdjustmentConfig()
    for point_id in point_ids:
        config.add_variable_point(point_id)
    pycolmap.create_default_bundle_adjuster(adjustment, config, reconstruction).solve()
