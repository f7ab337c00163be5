"""Random features: descriptors and places."""

from __future__ import annotations

import numpy as np

from sfm_front.types import Features


def random_descriptors(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (count, 128), dtype=np.uint8)


def features_of(descriptors: np.ndarray, seed: int = 0) -> Features:
    """Features with these descriptors, at random places and scales."""
    generator = np.random.default_rng(seed)
    keypoints = generator.uniform(1, 20, (len(descriptors), 4)).astype(np.float32)
    return Features(keypoints, descriptors, np.zeros((len(descriptors), 3), np.uint8))


def random_photos(count: int, num_features: int, seed: int = 0) -> list[Features]:
    descriptors = random_descriptors(count * num_features, seed)
    return [features_of(part, seed) for part in np.split(descriptors, count)]
