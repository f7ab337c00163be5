"""Bundle adjustment of a whole model with a robust loss."""

from __future__ import annotations

import statistics
from collections.abc import Collection
from dataclasses import dataclass

import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.mapping.refinement_schedule import LARGE
from sfm_front.mapping.thinned_adjustment import adjust_thinned

# In one model.
_MOST_PHOTOS = 1_000_000
# Up to so many photos, most of which see something in common, the matrix is taken as dense.
_DENSE_UP_TO = 100


@dataclass(frozen=True, kw_only=True)
class RobustAdjustmentOptions:
    """How a whole model is adjusted at the end."""

    # Reprojection error from which the Cauchy loss gives way (TUNING: robust-loss).
    loss_scale_px: float = 1.0
    # Relative change of the cost at which it stops, and that for large models: long flights stay
    # bent with looser ones (TUNING: robust-tolerance, large-tolerances).
    tolerance: float = 1e-4
    large_tolerance: float = 1e-8
    # Whether focal length and distortion may move, and the principal point of an unknown camera.
    refine_intrinsics: bool = True
    num_threads: int = 2
    # Registered photos from which the adjustment runs longer, as in ``ScheduleOptions``.
    large_from: int = LARGE

    def __post_init__(self) -> None:
        if self.loss_scale_px <= 0:
            raise ConfigError(f"loss_scale_px must be above 0, got {self.loss_scale_px}")
        for name in ("tolerance", "large_tolerance"):
            if getattr(self, name) < 0:
                raise ConfigError(f"{name} must not be negative, got {getattr(self, name)}")


def adjust_robustly(
    reconstruction: pycolmap.Reconstruction,
    options: RobustAdjustmentOptions,
    *,
    principal_point: bool,
) -> None:
    """Adjust the whole model with a Cauchy loss; ``principal_point``: whether it may move."""
    adjustment = robust_adjustment(options, reconstruction.num_reg_images())
    adjustment.refine_principal_point = principal_point
    adjust_all(reconstruction, adjustment)
    reconstruction.update_point_3d_errors()


def robust_adjustment(
    options: RobustAdjustmentOptions, num_photos: int
) -> pycolmap.BundleAdjustmentOptions:
    """pycolmap's options for a model of so many photos; the principal point stays."""
    adjustment = solved_directly(pycolmap.BundleAdjustmentOptions())
    adjustment.refine_focal_length = options.refine_intrinsics
    adjustment.refine_extra_params = options.refine_intrinsics
    adjustment.refine_principal_point = False
    adjustment.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    adjustment.ceres.loss_function_scale = options.loss_scale_px
    large = num_photos >= options.large_from
    adjustment.ceres.solver_options.function_tolerance = (
        options.large_tolerance if large else options.tolerance
    )
    adjustment.ceres.solver_options.num_threads = options.num_threads
    return adjustment


def solved_directly(
    adjustment: pycolmap.BundleAdjustmentOptions,
) -> pycolmap.BundleAdjustmentOptions:
    """The options given, without what COLMAP does with more than a thousand photos: it solves by
    conjugate gradients, which hardly move what has to be unbent. Photos that follow each other
    make a matrix so sparse that it is factorized in no time (TUNING: direct-solver)."""
    adjustment.ceres.max_num_images_direct_dense_cpu_solver = _DENSE_UP_TO
    adjustment.ceres.max_num_images_direct_sparse_cpu_solver = _MOST_PHOTOS
    adjustment.print_summary = False
    return adjustment


def adjust_all(
    reconstruction: pycolmap.Reconstruction, adjustment: pycolmap.BundleAdjustmentOptions
) -> None:
    """Adjust all registered photos and their points, two cameras fixing the gauge; a large model by
    some of its points, see ``thinned_adjustment``.

    As ``pycolmap.bundle_adjustment``, which prints about it whatever the log level.
    """

    def adjust(model: pycolmap.Reconstruction) -> None:
        config = pycolmap.BundleAdjustmentConfig()
        for image_id in model.reg_image_ids():
            config.add_image(image_id)
        config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
        pycolmap.create_default_bundle_adjuster(adjustment, config, model).solve()

    adjust_thinned(reconstruction, adjustment, adjust)


def median_error(
    reconstruction: pycolmap.Reconstruction, camera_ids: Collection[int] | None = None
) -> float:
    """Of the mean reprojection errors of its points, in pixels; 0 where there is no point.

    ``camera_ids``: only points that photos of these cameras see. Wrong matches move a mean.
    """
    points = list(reconstruction.points3D.values())
    if camera_ids is not None:
        photos = {
            i
            for i in reconstruction.reg_image_ids()
            if reconstruction.image(i).camera_id in camera_ids
        }
        points = [
            point for point in points if any(e.image_id in photos for e in point.track.elements)
        ]
    errors = [float(point.error) for point in points]
    return statistics.median(errors) if errors else 0.0
