"""The last bundle adjustment of a finished model."""

from __future__ import annotations

import pycolmap

from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions, adjust_robustly
from sfm_front.mapping.calibration import CalibrationOptions, with_principal_point


def final_adjustment(
    reconstruction: pycolmap.Reconstruction,
    options: RobustAdjustmentOptions,
    calibration: CalibrationOptions | None = None,
) -> pycolmap.Reconstruction:
    """The model after a bundle adjustment with a robust loss; the one given is changed as well.

    COLMAP ends with plain least squares, which wrong matches dominate (TUNING: robust-loss).

    Photos without EXIF have often been cropped. If all share one camera without a focal length
    prior, its principal point is refined too, and kept only if the error falls enough and the point
    stays near the centre. The error is the median: wrong matches, which no principal point
    explains, move the mean.

    Finally points that do not fit are dropped: the robust loss leaves them unconstrained.
    """
    adjust_robustly(reconstruction, options, principal_point=False)
    polished = with_principal_point(reconstruction, calibration or CalibrationOptions(), options)
    drop_misfits(polished)
    return polished


def drop_misfits(reconstruction: pycolmap.Reconstruction) -> None:
    """Drop points and observations that do not fit, by COLMAP's limits; errors are those now."""
    limits = pycolmap.IncrementalMapperOptions()
    pycolmap.ObservationManager(reconstruction).filter_all_points3D(
        limits.filter_max_reproj_error, limits.filter_min_tri_angle
    )
    reconstruction.update_point_3d_errors()
