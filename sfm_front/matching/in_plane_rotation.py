"""In-plane rotation between two photos, and which of their features may match under it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.geometry.angles import FULL_TURN, wrapped
from sfm_front.matching.match_mask import MaskBlock, MatchMask
from sfm_front.types import Float32Array


@dataclass(frozen=True, kw_only=True)
class RotationOptions:
    """When two photos have a common in-plane rotation, and which features it lets match."""

    # How far a feature may deviate from the pair's rotation, in degrees. Most verified matches
    # are within it (TUNING: rotation-tolerance).
    tolerance_deg: float = 20.0
    # Fewest verified matches that a rotation is estimated from.
    min_matches: int = 16
    # Share of these matches that must be within the tolerance.
    min_agreeing: float = 0.75
    # Sectors of the circle that features are grouped into; those of one sector are compared with
    # the same features of the other photo.
    num_sectors: int = 24

    def __post_init__(self) -> None:
        if not self.tolerance_deg > 0:
            raise ConfigError(f"tolerance_deg must be above 0, got {self.tolerance_deg}")
        if self.min_matches < 1:
            raise ConfigError(f"min_matches must be at least 1, got {self.min_matches}")
        if not 0 < self.min_agreeing <= 1:
            raise ConfigError(
                f"min_agreeing must be above 0 and at most 1, got {self.min_agreeing}"
            )
        if self.num_sectors < 1:
            raise ConfigError(f"num_sectors must be at least 1, got {self.num_sectors}")
        # Else a feature would be compared with the same one twice, and be its own runner-up.
        reach_deg = 360 / self.num_sectors + 2 * self.tolerance_deg
        if reach_deg >= 360:
            raise ConfigError(
                f"a sector of 360 / num_sectors and twice tolerance_deg must be below 360 degrees "
                f"in total, got {reach_deg:g}"
            )

    @property
    def tolerance_rad(self) -> np.float64:
        """``tolerance_deg`` in radians."""
        # Not a Python float: comparing float32 arrays with one would round it to float32.
        tolerance_rad: np.float64 = np.deg2rad(self.tolerance_deg)
        return tolerance_rad


def in_plane_rotation(
    keypoints1: Float32Array, keypoints2: Float32Array, options: RotationOptions
) -> float | None:
    """In-plane rotation in radians from photo 1 to photo 2, from matching keypoints (M, 4).

    None if there are too few matches or they disagree.
    """
    if len(keypoints1) < options.min_matches:
        return None
    rotations = np.exp(1j * (keypoints2[:, 3] - keypoints1[:, 3]))
    # Medians, not means: robust to outliers.
    common = float(np.angle(complex(np.median(rotations.real), np.median(rotations.imag))))
    agreeing = _apart_rad(keypoints1, keypoints2, common) < options.tolerance_rad
    return common if agreeing.mean() >= options.min_agreeing else None


def agrees_with_rotation(
    keypoints1: Float32Array, keypoints2: Float32Array, rotation_rad: float, tolerance_deg: float
) -> NDArray[np.bool_]:
    """(M,) whether matching keypoints (M, 4) rotate by ``rotation_rad``, within the tolerance."""
    agrees: NDArray[np.bool_] = _apart_rad(keypoints1, keypoints2, rotation_rad) < np.deg2rad(
        tolerance_deg
    )
    return agrees


def _apart_rad(
    keypoints1: Float32Array, keypoints2: Float32Array, rotation_rad: float
) -> NDArray[np.floating[Any]]:
    """(M,) deviation of matching keypoints (M, 4) from this rotation."""
    apart: NDArray[np.floating[Any]] = np.abs(
        wrapped(keypoints2[:, 3] - keypoints1[:, 3] - rotation_rad)
    )
    return apart


def rotation_mask(
    orientations1: Float32Array,
    orientations2: Float32Array,
    rotation_rad: float,
    options: RotationOptions,
) -> MatchMask:
    """Features (N,) and (M,) that may match if photo 2 is rotated by this against photo 1.

    Each feature of photo 1 is compared with those of photo 2 within the tolerance of its rotated
    orientation, and with some up to a sector beyond it. By default that is a sixth of all pairs if
    orientations are spread.
    """
    tolerance_rad = options.tolerance_rad
    expected = np.mod(orientations1 + rotation_rad, FULL_TURN)
    found = np.mod(orientations2, FULL_TURN)
    order1, order2 = np.argsort(expected, kind="stable"), np.argsort(found, kind="stable")
    found = found[order2]
    below, above = np.searchsorted(found, (tolerance_rad, FULL_TURN - tolerance_rad))
    circle = np.concatenate([found[above:] - FULL_TURN, found, found[:below] + FULL_TURN])
    return MatchMask(
        order1,
        np.concatenate([order2[above:], order2, order2[:below]]),
        _blocks(expected[order1], circle, options),
    )


def _blocks(
    expected: Float32Array, found: Float32Array, options: RotationOptions
) -> Iterator[MaskBlock]:
    edges = np.linspace(0, FULL_TURN, options.num_sectors + 1)
    rows = np.searchsorted(expected, edges)
    rows[-1] = len(expected)
    first = np.searchsorted(found, edges[:-1] - options.tolerance_rad)
    last = np.searchsorted(found, edges[1:] + options.tolerance_rad)
    for sector in range(options.num_sectors):
        yield MaskBlock(slice(rows[sector], rows[sector + 1]), slice(first[sector], last[sector]))
