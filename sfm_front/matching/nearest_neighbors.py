"""Descriptors × descriptors → tentative matches: nearest neighbours, ratio test, mutual check."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sfm_front.errors import ConfigError
from sfm_front.matching.in_plane_rotation import RotationOptions, rotation_mask
from sfm_front.matching.match_mask import MaskBlock, MatchMask
from sfm_front.types import DESCRIPTOR_NORM, Features, Float32Array, Uint8Array, Uint32Array

SQUARED_NORM = DESCRIPTOR_NORM**2
# Rows of similarities that stay in the CPU cache between passes (TUNING: row-block).
_BLOCK = 256
NO_MATCHES: Uint32Array = np.zeros((0, 2), np.uint32)


@dataclass(frozen=True, kw_only=True)
class MatchingOptions:
    """COLMAP's tests on the angle between descriptors, the ratio test in one direction only."""

    # Largest ratio of the nearest neighbour's angle to the second nearest's.
    max_ratio: float = 0.8
    # Largest angle between the descriptors of a match, in radians.
    max_angle_rad: float = 0.7
    # Which features are compared if the photos' in-plane rotation is known.
    rotation: RotationOptions = field(default_factory=RotationOptions)

    def __post_init__(self) -> None:
        if not 0 < self.max_ratio <= 1:
            raise ConfigError(f"max_ratio must be above 0 and at most 1, got {self.max_ratio}")
        if self.max_angle_rad <= 0:
            raise ConfigError(f"max_angle_rad must be above 0, got {self.max_angle_rad}")


def match_descriptors(
    descriptors1: Uint8Array, descriptors2: Uint8Array, options: MatchingOptions
) -> Uint32Array:
    """RootSIFT (N, 128) and (M, 128) uint8 → mutual nearest neighbours (K, 2) uint32.

    A row holds the indices in the first and in the second set, sorted by the first; no index
    occurs twice. Exact: the similarities are integers that float32 can represent. One matrix
    product serves both directions, in blocks of rows that fit the CPU cache.
    """
    count1, count2 = len(descriptors1), len(descriptors2)
    blocks = [
        MaskBlock(slice(start, min(start + _BLOCK, count1)), slice(0, count2))
        for start in range(0, count1, _BLOCK)
    ]
    everything = MatchMask(np.arange(count1), np.arange(count2), blocks)
    return match_masked(descriptors1, descriptors2, everything, options)


def match_rotated(
    features1: Features, features2: Features, rotation_rad: float, options: MatchingOptions
) -> Uint32Array:
    """Like ``match_descriptors``, between features that agree with the in-plane rotation only.

    Faster, and with more inliers: features that cannot match do not count as second nearest
    neighbours either (TUNING: rotation-matching).
    """
    mask = rotation_mask(
        features1.keypoints[:, 3], features2.keypoints[:, 3], rotation_rad, options.rotation
    )
    return match_masked(features1.descriptors, features2.descriptors, mask, options)


def match_masked(
    descriptors1: Uint8Array, descriptors2: Uint8Array, mask: MatchMask, options: MatchingOptions
) -> Uint32Array:
    """Like ``match_descriptors``, but only the pairs that the mask allows are compared."""
    first = descriptors1[mask.order1].astype(np.float32)
    second = descriptors2[mask.order2].astype(np.float32)
    index2 = mask.order2
    count = len(first)
    nearest = np.zeros(count, np.intp)
    best = np.full(count, -1, np.float32)
    runner_up = np.full(count, -1, np.float32)
    best_of_second = np.zeros(index2.max(initial=-1) + 1, np.float32)
    for rows, columns, allowed in mask.blocks:
        index = index2[columns]
        if rows.stop == rows.start or len(index) < 2:
            continue
        similarity = first[rows] @ second[columns].T
        if allowed is not None:
            similarity *= allowed
        best_of_second[index] = np.maximum(best_of_second[index], similarity.max(axis=0))
        row = np.arange(len(similarity))
        of_row = similarity.argmax(axis=1)
        nearest[rows] = index[of_row]
        best[rows] = similarity[row, of_row]
        similarity[row, of_row] = -1
        runner_up[rows] = similarity.max(axis=1)
    if count == 0 or len(best_of_second) == 0:
        return NO_MATCHES
    angle = _angle(best)
    kept = np.flatnonzero(
        (angle <= options.max_angle_rad)
        & (angle < options.max_ratio * _angle(runner_up))
        & (best == best_of_second[nearest])
    )
    # Equal descriptors in the first photo have the same nearest neighbour: the first one gets it.
    found = mask.order1[kept]
    order = np.argsort(found)
    targets, once = np.unique(nearest[kept][order], return_index=True)
    matches = np.stack([found[order][once], targets], axis=1).astype(np.uint32)
    return matches[np.argsort(matches[:, 0])]


def _angle(similarity: Float32Array) -> Float32Array:
    angle: Float32Array = np.arccos(np.minimum(similarity / SQUARED_NORM, 1.0))
    return angle
