"""Whether photos determine their cameras, and the principal point of a camera nobody knows."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.mapping.bundle_adjustment import (
    RobustAdjustmentOptions,
    adjust_robustly,
    median_error,
)


@dataclass(frozen=True, kw_only=True)
class CalibrationOptions:
    """When a principal point that was refined is kept."""

    # Photos that must share the camera.
    min_photos: int = 8
    # Share of the median reprojection error that must go (TUNING: principal-point-gain).
    min_gain: float = 0.035
    # Of the long side; a model that wants its principal point farther out is not determined.
    max_shift: float = 0.025

    def __post_init__(self) -> None:
        if self.min_photos < 1:
            raise ConfigError(f"min_photos must be at least 1, got {self.min_photos}")
        for name in ("min_gain", "max_shift"):
            value = getattr(self, name)
            if not 0 <= value < 1:
                raise ConfigError(f"{name} must be from 0 to below 1, got {value}")


def impossible_photos(
    reconstruction: pycolmap.Reconstruction, limits: pycolmap.IncrementalMapperOptions
) -> list[int]:
    """Registered photos whose focal length or distortion has left these limits: image ids."""
    return [
        image_id
        for image_id in reconstruction.reg_image_ids()
        if reconstruction.camera(reconstruction.image(image_id).camera_id).has_bogus_params(
            limits.min_focal_length_ratio, limits.max_focal_length_ratio, limits.max_extra_param
        )
    ]


def is_miscalibrated(
    reconstruction: pycolmap.Reconstruction, limits: pycolmap.IncrementalMapperOptions
) -> bool:
    """Whether most photos have a camera that cannot be: they do not tell what it is."""
    return 2 * len(impossible_photos(reconstruction, limits)) > reconstruction.num_reg_images()


def with_principal_point(
    reconstruction: pycolmap.Reconstruction,
    options: CalibrationOptions,
    adjustment: RobustAdjustmentOptions,
) -> pycolmap.Reconstruction:
    """The model adjusted with its principal point where that is better, or the one given."""
    camera_id = _only_camera_id(reconstruction)
    if (
        camera_id is None
        or not adjustment.refine_intrinsics
        or reconstruction.num_reg_images() < options.min_photos
        or reconstruction.camera(camera_id).has_prior_focal_length
    ):
        return reconstruction
    moved = copy.deepcopy(reconstruction)
    adjust_robustly(moved, adjustment, principal_point=True)
    return moved if _is_better(moved, reconstruction, camera_id, options) else reconstruction


def _only_camera_id(reconstruction: pycolmap.Reconstruction) -> int | None:
    """The camera of all registered photos; None where there are several."""
    used = {int(reconstruction.image(i).camera_id) for i in reconstruction.reg_image_ids()}
    return used.pop() if len(used) == 1 else None


def _is_better(
    moved: pycolmap.Reconstruction,
    fixed: pycolmap.Reconstruction,
    camera_id: int,
    options: CalibrationOptions,
) -> bool:
    if median_error(moved) > (1 - options.min_gain) * median_error(fixed):
        return False
    camera = moved.camera(camera_id)
    shift_px = math.dist(
        (camera.principal_point_x, camera.principal_point_y),
        (camera.width / 2, camera.height / 2),
    )
    return shift_px <= options.max_shift * max(camera.width, camera.height)
