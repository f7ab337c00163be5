"""Which matches of two photos fit an essential matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sfm_front.types import Float64Array


def fits_epipolar(
    essential: Float64Array, rays1: Float64Array, rays2: Float64Array, max_error: float
) -> NDArray[np.bool_]:
    """(M,) whether the Sampson error of each match under x2ᵀ E x1 = 0 is at most ``max_error``.

    ``rays1``, ``rays2`` (M, 3): those of ``undistorted_rays``, in each photo's own camera frame.
    The error is in units of the plane z = 1: pixels over the focal length.
    """
    lines2 = rays1 @ essential.T
    lines1 = rays2 @ essential
    algebraic = np.einsum("ij,ij->i", rays2, lines2)
    gradient = (lines1[:, :2] ** 2).sum(axis=1) + (lines2[:, :2] ** 2).sum(axis=1)
    # As a comparison that is False for nan: rays that cannot be undistorted are outliers.
    fits: NDArray[np.bool_] = algebraic**2 <= max_error**2 * gradient
    return fits
