"""Photos that nobody took, to fill an index with: made of parts of real ones.

What a query costs depends on how many photos are indexed, and hardly on what they show, as long as
their vectors and descriptors are spread as real ones are. So a published dataset's size can be
timed without its photos. A distractor is like a real photo in

- its global vectors: see ``distractor_vectors``;
- its features: the four rows of cells of a SIFT descriptor, each from another real one, at real
  keypoints in no order. Over 100 pairs of photos of three scenes, 800 features each, 5 (median)
  matched between a photo and a distractor, 6 between photos of different scenes, and RANSAC kept
  none of either.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import overload

import numpy as np
import pycolmap

from sfm_front.evaluation.retrieval.distractor_vectors import VectorMaker
from sfm_front.evaluation.retrieval.types import BenchPhoto
from sfm_front.types import Features, Float32Array, View

# Numbers in a row of the four times four cells of a SIFT descriptor, of eight directions each.
_ROW_OF_CELLS = 32
# Features that all distractors share, each through a window of its own: 53 MB.
_POOL = 400_000
# Of distractors' image ids: far above those of real photos.
_FIRST_ID = 1_000_000_000


class WithDistractors(Sequence[BenchPhoto]):
    """Real photos, then distractors up to ``size``, each made when it is asked for.

    Making them on demand keeps 100 000 of them small: their features are windows on one pool, and
    of their vectors nothing stays but what an index keeps. The same index gives the same photo.
    """

    def __init__(
        self, photos: Sequence[BenchPhoto], size: int, num_features: int, *, seed: int = 0
    ) -> None:
        """``num_features``: of each distractor. ``photos``: two at least."""
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
    """As many features as all photos have, or ``_POOL``; none of them is a photo's."""
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
    """A distractor's vectors, each made anew whenever it is asked for."""

    def __init__(self, makers: Mapping[str, VectorMaker], seed: Sequence[int]) -> None:
        self._makers = makers
        self._seed = seed

    def __getitem__(self, name: str) -> Float32Array:
        return self._makers[name].make(np.random.default_rng(self._seed))

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)
