"""When a camera's photos determine it, and what its last refinement must bring."""

from __future__ import annotations

from dataclasses import dataclass

import pycolmap

from sfm_front.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class CalibrationOptions:
    """When a richer lens, or a principal point that was refined, is kept."""

    # Whether SIMPLE_RADIAL may become RADIAL, and RADIAL OPENCV.
    grow_lens: bool = True
    # Photos that must share the camera.
    min_photos: int = 8
    # Share of the median reprojection error that each step must take away (TUNING: lens-gain).
    min_gain: float = 0.01
    # Share of that which residuals must promise for a lens to be tried (TUNING: lens-promise).
    promise_share: float = 0.65
    # Of the long side; a model that wants its principal point farther out is not determined.
    max_shift: float = 0.025
    # Standard deviation of the focal length as a share of it, up to which photos determine their
    # camera (TUNING: focal-sigma).
    max_focal_sigma: float = 0.004

    def __post_init__(self) -> None:
        if self.min_photos < 1:
            raise ConfigError(f"min_photos must be at least 1, got {self.min_photos}")
        for name in ("min_gain", "promise_share", "max_shift", "max_focal_sigma"):
            value = getattr(self, name)
            if not 0 <= value < 1:
                raise ConfigError(f"{name} must be from 0 to below 1, got {value}")


def photos_by_camera(reconstruction: pycolmap.Reconstruction) -> dict[int, list[int]]:
    """Camera id → image ids of its registered photos, both sorted."""
    photos: dict[int, list[int]] = {}
    for image_id in sorted(reconstruction.reg_image_ids()):
        photos.setdefault(int(reconstruction.image(image_id).camera_id), []).append(image_id)
    return dict(sorted(photos.items()))


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
