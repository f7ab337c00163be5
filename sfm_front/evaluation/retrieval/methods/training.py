"""Descriptors to learn visual words from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sfm_front.errors import ConfigError
from sfm_front.evaluation.retrieval.types import BenchPhoto
from sfm_front.types import Float32Array

FEWEST_WORDS = 1024
"""With fewer, every photo of a small collection has every word, and none distinguishes them."""


def num_words_for(photos: Sequence[BenchPhoto], *, per_word: int, most: int) -> int:
    """One word per ``per_word`` descriptors of these photos: ``FEWEST_WORDS`` to ``most``, but
    never more than descriptors. Raises ConfigError if there are no descriptors."""
    total = sum(len(photo.view.features) for photo in photos)
    if total == 0:
        raise ConfigError("none of the photos has features: there are no visual words to learn")
    return min(max(FEWEST_WORDS, total // per_word), most, total)


def sample_descriptors(photos: Sequence[BenchPhoto], count: int, seed: int) -> Float32Array:
    """(n, 128) float32 RootSIFT: ``count`` drawn from all photos, or all if there are fewer."""
    sizes = [len(photo.view.features) for photo in photos]
    total = sum(sizes)
    drawn = np.arange(total)
    if total > count:
        drawn = np.sort(np.random.default_rng(seed).choice(total, count, replace=False))
    ends = np.cumsum(sizes)
    parts = np.split(drawn, np.searchsorted(drawn, ends[:-1]))
    return np.concatenate(
        [
            photo.view.features.descriptors[part - (end - size)].astype(np.float32)
            for photo, part, end, size in zip(photos, parts, ends, sizes, strict=True)
        ]
    )
