"""Synthetic photos to fill an index with, made of parts of real ones.

The cost of a query depends on the number of photos in the index and hardly on what they show, if
their vectors and descriptors are distributed like real ones. So retrieval can be timed at a
published dataset's size without its photos. A distractor resembles a real photo in

- its global vectors: see ``distractor_vectors``;
- its features: the four rows of cells of a SIFT descriptor, each from a different real one, at
  shuffled real keypoints. They match real photos about as often as unrelated photos do, and RANSAC
  rejects these matches (TUNING: distractor-features).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import overload

import numpy as np
import pycolmap

from sfm_front.evaluation.retrieval.distractor_vectors import VectorMaker
from sfm_front.evaluation.retrieval.types import BenchPhoto
from sfm_front.types import Features, Float32Array, View

# A row of a SIFT descriptor's 4 x 4 cells of 8 directions.
_ROW_OF_CELLS = 32
# Features that all distractors share, each through its own window: 53 MB of descriptors.
_POOL = 400_000
# Image ids of distractors start here, far above those of real photos.
_FIRST_ID = 1_000_000_000


class WithDistractors(Sequence[BenchPhoto]):
    """Real photos, then distractors up to ``size``, made on access.

    So 100 000 of them need little memory: their features are windows on one pool, and their vectors
    are not kept. The same position always gives the same photo.
    """

    def __init__(
        self, photos: Sequence[BenchPhoto], size: int, num_features: int, *, seed: int = 0
    ) -> None:
        """``num_features`` per distractor; at least two ``photos``."""
        self._photos = photos
        self._size = max(size, len(photos))
        self._seed = seed
        self._camera = photos[0].view.camera
        self._makers = {
            name: VectorMaker(np.stack([photo.vectors[name] for photo in photos]))
            for name in photos[0].vectors
        }
        self._hash_shape = photos[0].perceptual_hash.shape
        self._pool = _pooled([photo.view.features for photo in photos], self._camera, seed)
        self._num_features = min(num_features, len(self._pool))

    def __len__(self) -> int:
        return self._size

    @overload
    def __getitem__(self, index: int) -> BenchPhoto: ...

    @overload
    def __getitem__(self, index: slice) -> list[BenchPhoto]: ...

    def __getitem__(self, index: int | slice) -> BenchPhoto | list[BenchPhoto]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(self._size))]
        position = range(self._size)[index]
        if position < len(self._photos):
            return self._photos[position]
        return self._distractor(position - len(self._photos))

    def _distractor(self, number: int) -> BenchPhoto:
        rng = np.random.default_rng([self._seed, number])
        start = int(rng.integers(len(self._pool) - self._num_features + 1))
        window = slice(start, start + self._num_features)
        pool = self._pool
        features = Features(pool.keypoints[window], pool.descriptors[window], pool.colors[window])
        return BenchPhoto(
            view=View(_FIRST_ID + number, self._camera, features),
            vectors=_LazyVectors(self._makers, [self._seed, number]),
            perceptual_hash=rng.integers(0, 256, self._hash_shape, np.uint8),
        )


def _pooled(parts: Sequence[Features], camera: pycolmap.Camera, seed: int) -> Features:
    """Mixed features, as many as all photos have, at most ``_POOL``."""
    rng = np.random.default_rng(seed)
    descriptors = np.concatenate([part.descriptors for part in parts])
    keypoints = np.concatenate([part.keypoints for part in parts])
    count = min(_POOL, len(descriptors))
    mixed = np.empty((count, descriptors.shape[1]), np.uint8)
    for start in range(0, descriptors.shape[1], _ROW_OF_CELLS):
        row = slice(start, start + _ROW_OF_CELLS)
        mixed[:, row] = descriptors[rng.permutation(len(descriptors))[:count], row]
    torn = keypoints[rng.permutation(len(keypoints))[:count]]
    # Real photos differ in size; distractors have one camera.
    torn[:, :2] %= np.array([camera.width, camera.height], np.float32)
    return Features(torn, mixed, np.zeros((count, 3), np.uint8))


class _LazyVectors(Mapping[str, Float32Array]):
    """A distractor's vectors, computed on each access."""

    def __init__(self, makers: Mapping[str, VectorMaker], seed: Sequence[int]) -> None:
        self._makers = makers
        self._seed = seed

    def __getitem__(self, name: str) -> Float32Array:
        return self._makers[name].make(np.random.default_rng(self._seed))

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)
