"""What a model knows beside its reconstruction."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ModelState:
    """What a model knows beside its reconstruction, to go on from one read from disk."""

    model_id: int
    # Photos and points at its last global refinement.
    refined_images: int
    refined_points: int
    # Inliers it asks of a photo's pose: fewer if it started from few points.
    min_pose_inliers: int
    # False if it was grown with its camera fixed.
    refine_intrinsics: bool
    # Whether its world is a frame of the earth.
    is_georeferenced: bool = False
    # Whether its photos have once determined its camera.
    is_camera_determined: bool = True
