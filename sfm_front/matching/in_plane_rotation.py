"""In-plane rotation between two photos, and which of their features may match under it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sfm_front.geometry.angles import FULL_TURN, wrapped
from sfm_front.matching.match_mask import MaskBlock, MatchMask
from sfm_front.types import Float32Array

# Most verified matches agree within this with the pair's rotation (TUNING: rotation-tolerance).
TOLERANCE_RAD = np.deg2rad(20)
_MATCH_TOLERANCE_RAD = np.deg2rad(30)
_MIN_MATCHES = 16
_MIN_AGREEING = 0.75
NUM_SECTORS = 24


def in_plane_rotation(keypoints1: Float32Array, keypoints2: Float32Array) -> float | None:
    """In-plane rotation in radians from photo 1 to photo 2, by matching keypoints (M, 4).

    None if there are too few matches or they disagree.
    """
    if len(keypoints1) < _MIN_MATCHES:
        return None
    turns = np.exp(1j * (keypoints2[:, 3] - keypoints1[:, 3]))
    # Medians, not means: robust to outliers.
    common = float(np.angle(complex(np.median(turns.real), np.median(turns.imag))))
    agreeing = _apart_rad(keypoints1, keypoints2, common) < TOLERANCE_RAD
    return common if agreeing.mean() >= _MIN_AGREEING else None


def agrees_with_rotation(
    keypoints1: Float32Array, keypoints2: Float32Array, rotation_rad: float
) -> NDArray[np.bool_]:
    """(M,) whether matching keypoints (M, 4) rotate by this much, within 30 degrees."""
    alike: NDArray[np.bool_] = (
        _apart_rad(keypoints1, keypoints2, rotation_rad) < _MATCH_TOLERANCE_RAD
    )
    return alike


def _apart_rad(
    keypoints1: Float32Array, keypoints2: Float32Array, rotation_rad: float
) -> NDArray[np.floating[Any]]:
    """(M,) deviation of matching keypoints (M, 4) from this rotation."""
    apart: NDArray[np.floating[Any]] = np.abs(
        wrapped(keypoints2[:, 3] - keypoints1[:, 3] - rotation_rad)
    )
    return apart


def rotation_mask(
    orientations1: Float32Array, orientations2: Float32Array, rotation_rad: float
) -> MatchMask:
    """Features (N,) and (M,) that may match if photo 2 is rotated by this against photo 1.

    Each feature of photo 1 is compared to those of photo 2 within 20 degrees of its rotated
    orientation, and to some up to 35 degrees away: a sixth of all pairs if orientations are spread.
    """
    expected = np.mod(orientations1 + rotation_rad, FULL_TURN)
    found = np.mod(orientations2, FULL_TURN)
    order1, order2 = np.argsort(expected, kind="stable"), np.argsort(found, kind="stable")
    found = found[order2]
    below, above = np.searchsorted(found, (TOLERANCE_RAD, FULL_TURN - TOLERANCE_RAD))
    circle = np.concatenate([found[above:] - FULL_TURN, found, found[:below] + FULL_TURN])
    return MatchMask(
        order1,
        np.concatenate([order2[above:], order2, order2[:below]]),
        _blocks(expected[order1], circle),
    )


def _blocks(expected: Float32Array, found: Float32Array) -> Iterator[MaskBlock]:
    edges = np.linspace(0, FULL_TURN, NUM_SECTORS + 1)
    rows = np.searchsorted(expected, edges)
    rows[-1] = len(expected)
    first = np.searchsorted(found, edges[:-1] - TOLERANCE_RAD)
    last = np.searchsorted(found, edges[1:] + TOLERANCE_RAD)
    for sector in range(NUM_SECTORS):
        yield MaskBlock(slice(rows[sector], rows[sector + 1]), slice(first[sector], last[sector]))
