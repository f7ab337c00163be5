"""Measured positions of photos in the adjustment of a model that stands in their frame."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.mapping.bundle_adjustment import (
    RobustAdjustmentOptions,
    median_error,
    robust_adjustment,
)
from sfm_front.mapping.thinned_adjustment import adjust_thinned
from sfm_front.types import Float64Array

# COLMAP falls back to a fixed gauge with fewer, and does not say so.
_MIN_PRIORS = 3


@dataclass(frozen=True, kw_only=True)
class PriorOptions:
    """How far positions may move a model."""

    # The median reprojection error may rise by this share. If it rises further, positions and
    # photos contradict each other: the model stays as the photos have it.
    max_error_rise: float = 0.03
    # Standard deviations from which a position loses weight: 95 % of right ones are within.
    loss_scale: float = 2.7954834829151074

    def __post_init__(self) -> None:
        if self.max_error_rise < 0:
            raise ConfigError(f"max_error_rise must not be negative, got {self.max_error_rise}")
        if self.loss_scale <= 0:
            raise ConfigError(f"loss_scale must be above 0, got {self.loss_scale}")


@dataclass(frozen=True, slots=True, eq=False)
class PositionPriors:
    """Where photos were measured to be, by image id, in the frame of the model.

    ``positions`` (3,) in metres, ``sigmas`` (3,) their standard deviations along the axes.
    """

    positions: Mapping[int, Float64Array]
    sigmas: Mapping[int, Float64Array]

    @property
    def are_enough(self) -> bool:
        """Whether a model can be held to them."""
        return len(self.positions) >= _MIN_PRIORS


def held_to_positions(
    reconstruction: pycolmap.Reconstruction,
    priors: PositionPriors,
    adjustment: RobustAdjustmentOptions,
    options: PriorOptions,
) -> pycolmap.Reconstruction | None:
    """A copy of a whole model, adjusted to photos and positions together; None if that does not fit
    the photos any more.

    ``reconstruction`` is in the frame of the positions and has been adjusted without them.
    """
    rows = _pose_priors(reconstruction, priors)
    if len(rows) < _MIN_PRIORS:
        return None
    held = copy.deepcopy(reconstruction)
    weighing = pycolmap.PosePriorBundleAdjustmentOptions()
    weighing.alignment_ransac.random_seed = 0
    weighing.ceres.prior_position_loss_function_type = pycolmap.LossFunctionType.CAUCHY
    weighing.ceres.prior_position_loss_scale = options.loss_scale
    robust = robust_adjustment(adjustment, held.num_reg_images())

    def hold(model: pycolmap.Reconstruction) -> None:
        config = pycolmap.BundleAdjustmentConfig()
        for image_id in model.reg_image_ids():
            config.add_image(image_id)
        # It moves the model when it is made, and back when it has solved.
        pycolmap.create_pose_prior_bundle_adjuster(robust, weighing, config, rows, model).solve()

    adjust_thinned(held, robust, hold)
    held.update_point_3d_errors()
    limit = (1 + options.max_error_rise) * median_error(reconstruction)
    return held if median_error(held) <= limit else None


def _pose_priors(
    reconstruction: pycolmap.Reconstruction, priors: PositionPriors
) -> list[pycolmap.PosePrior]:
    rows = []
    for image_id in reconstruction.reg_image_ids():
        if image_id in priors.positions:
            rows.append(
                pycolmap.PosePrior(
                    corr_data_id=reconstruction.image(image_id).data_id,
                    position=priors.positions[image_id],
                    position_covariance=np.diag(priors.sigmas[image_id] ** 2),
                    coordinate_system=pycolmap.PosePriorCoordinateSystem.CARTESIAN,
                )
            )
    return rows
