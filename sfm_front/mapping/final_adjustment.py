"""The last bundle adjustment of a finished model."""

from __future__ import annotations

import pycolmap

from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions, adjust_robustly
from sfm_front.mapping.calibration import CalibrationOptions
from sfm_front.mapping.lens_growth import GrownModel, with_grown_lenses


def final_adjustment(
    reconstruction: pycolmap.Reconstruction,
    options: RobustAdjustmentOptions,
    calibration: CalibrationOptions | None = None,
) -> GrownModel:
    """The model after a bundle adjustment with a robust loss; the one given may change as well.

    It has been adjusted so on some of its points. COLMAP ends with plain least squares, which
    wrong matches dominate (TUNING: robust-loss).

    While it grew, its cameras had simple lenses, with the principal point in the middle: richer
    ones, before there are photos enough, diverge. Now they get what the photos bear out, which
    adjusts them; else it is done here. Finally points that do not fit are dropped: the robust loss
    leaves them unconstrained.
    """
    grown = with_grown_lenses(reconstruction, calibration or CalibrationOptions(), options)
    if grown.reconstruction is reconstruction:
        adjust_robustly(reconstruction, options, principal_point=False)
    drop_misfits(grown.reconstruction)
    return grown


def drop_misfits(reconstruction: pycolmap.Reconstruction) -> None:
    """Drop points and observations that do not fit, by COLMAP's limits; errors are those now."""
    limits = pycolmap.IncrementalMapperOptions()
    pycolmap.ObservationManager(reconstruction).filter_all_points3D(
        limits.filter_max_reproj_error, limits.filter_min_tri_angle
    )
    reconstruction.update_point_3d_errors()
