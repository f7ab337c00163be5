"""Descriptors × descriptors → tentative matches: nearest neighbours, ratio test, mutual check."""

from __future__ import annotations

from dataclasses import dataclass

import faiss
import numpy as np

from sfm_front.errors import ConfigError
from sfm_front.types import Float32Array, Uint8Array, Uint32Array

_SQUARED_NORM = 512.0**2
NO_MATCHES: Uint32Array = np.zeros((0, 2), np.uint32)


@dataclass(frozen=True, kw_only=True)
class MatchingOptions:
    """COLMAP's tests on the angle between descriptors.

    ``max_ratio``: the nearest neighbour's angle over the second nearest's.
    ``max_angle_rad``: the largest angle of a match.
    """

    max_ratio: float = 0.8
    max_angle_rad: float = 0.7

    def __post_init__(self) -> None:
        if not 0 < self.max_ratio <= 1:
            raise ConfigError(f"max_ratio must be above 0 and at most 1, got {self.max_ratio}")
        if self.max_angle_rad <= 0:
            raise ConfigError(f"max_angle_rad must be above 0, got {self.max_angle_rad}")


def match(
    descriptors1: Uint8Array, descriptors2: Uint8Array, options: MatchingOptions
) -> Uint32Array:
    """RootSIFT (N, 128) and (M, 128) uint8 → mutual nearest neighbours (K, 2) uint32.

    A row holds the index in the first and in the second; rows rise in the first column.
    faiss' exact search runs on as many threads as the calling thread has been given.
    """
    if len(descriptors1) < 2 or len(descriptors2) < 2:
        return NO_MATCHES
    first = descriptors1.astype(np.float32)
    second = descriptors2.astype(np.float32)
    similarity, nearest = faiss.knn(first, second, 2, metric=faiss.METRIC_INNER_PRODUCT)
    angle = _angle(similarity)
    kept = np.flatnonzero(
        (angle[:, 0] <= options.max_angle_rad)
        & (angle[:, 0] <= options.max_ratio * angle[:, 1])
    )
    if len(kept) == 0:
        return NO_MATCHES
    # Only what passed is searched back: a few hundred rows instead of thousands.
    targets = nearest[kept, 0]
    _, back = faiss.knn(second[targets], first, 1, metric=faiss.METRIC_INNER_PRODUCT)
    mutual = back[:, 0] == kept
    return np.stack([kept[mutual], targets[mutual]], axis=1).astype(np.uint32)


def _angle(similarity: Float32Array) -> Float32Array:
    angle: Float32Array = np.arccos(np.minimum(similarity / _SQUARED_NORM, 1.0))
    return angle
