"""Coarse retrieval: a growing cosine index over global vectors.

A query compares the short codes of all photos, then the vectors of the nearest. A code holds the
signs of the randomly rotated vector: the share of bits in which two codes differ grows with the
angle between their vectors. Vectors are stored at 8 bits per number.

Sources: Charikar, "Similarity estimation techniques from rounding algorithms", STOC 2002 (codes);
Chum et al., "Total recall: automatic query expansion with a generative feature model for object
retrieval", ICCV 2007.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import faiss
import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.types import Candidate, Float32Array, Uint8Array

# A vector is rotated as a matrix with this many columns; the result has this many rows.
_COLUMNS = 128
_CODE_ROWS = 128


@dataclass(frozen=True, kw_only=True)
class IndexOptions:
    """How many photos a query compares at each step."""

    # Photos of nearest codes whose vectors are compared; four times those requested if that is
    # more. More take longer and hardly find more (TUNING: shortlist).
    shortlist: int = 192
    # So many times the square root of the photos, if that is more still: among more photos, more
    # have codes as near as those of the nearest (TUNING: shortlist-growth).
    shortlist_growth: float = 14.0
    # Photos that an expanded query re-orders; twice those requested if that is more. The whole
    # shortlist takes longer and gives the same (TUNING: expansion-depth).
    expansion_depth: int = 100

    def __post_init__(self) -> None:
        for name in ("shortlist", "expansion_depth"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not 0 <= self.shortlist_growth < math.inf:
            raise ConfigError(f"shortlist_growth must not be negative, got {self.shortlist_growth}")

    def num_compared(self, num_photos: int, count: int) -> int:
        """Photos whose vectors a query for the nearest ``count`` of ``num_photos`` compares."""
        growing = math.ceil(self.shortlist_growth * math.sqrt(num_photos))
        return min(num_photos, max(self.shortlist, 4 * count, growing))


class CosineIndex:
    """Unit vectors of photos, compared by cosine. Adding is amortised constant time.

    Exhaustive up to ``IndexOptions.shortlist`` photos, approximate beyond. Cosines are accurate to
    0.001. A photo takes one byte per number plus 2 kB: 18 kB with VLAD of 16 384 numbers.
    """

    def __init__(self, dimension: int, options: IndexOptions | None = None) -> None:
        self._options = options or IndexOptions()
        # An empty folder's vectors have dimension 0, which faiss does not accept.
        dimension = max(1, dimension)
        self._encoder = _SignEncoder(dimension)
        self._codes = faiss.IndexBinaryFlat(_CODE_ROWS * _COLUMNS)
        self._vectors = faiss.IndexScalarQuantizer(
            dimension, faiss.ScalarQuantizer.QT_8bit_uniform, faiss.METRIC_INNER_PRODUCT
        )
        # Sets the value range; each vector is scaled to it.
        self._vectors.train(np.outer([-1, 1], np.ones(dimension)).astype(np.float32))
        self._peaks: list[float] = []
        self._image_ids: list[int] = []
        self._rows: dict[int, int] = {}

    def __len__(self) -> int:
        return len(self._image_ids)

    def add(self, image_id: int, vector: Float32Array) -> None:
        """Add a photo with its (dimension,) vector of length 1."""
        peak = float(np.abs(vector).max()) or 1.0
        self._codes.add(self._encoder.encode(vector)[np.newaxis])
        self._vectors.add(vector[np.newaxis] / np.float32(peak))
        self._peaks.append(peak)
        self._rows[image_id] = len(self)
        self._image_ids.append(image_id)

    def vector(self, image_id: int) -> Float32Array:
        """The (dimension,) vector of a photo, as far as 8 bits per number keep it."""
        row = self._rows[image_id]
        vector: Float32Array = self._vectors.reconstruct(row) * np.float32(self._peaks[row])
        return vector

    def query(
        self,
        vector: Float32Array,
        count: int,
        *,
        num_expansion: int = 0,
        expand_with: Iterable[int] = (),
    ) -> list[Candidate]:
        """The ``count`` photos nearest to the (dimension,) vector with their cosines, best first;
        ties by order of arrival.

        ``num_expansion``: number of top results that are added to the vector, each weighted by its
        cosine; ``expand_with``: photos added likewise. The expanded vector orders the best
        ``IndexOptions.expansion_depth``; reported cosines remain those with the original vector.
        """
        rows = self._shortlist(vector, self._options.num_compared(len(self), count))
        cosines = scores = self._cosines(vector, rows)
        best = (int(rows[i]) for i in _best(cosines, num_expansion))
        companions = {*best, *(self._rows[image_id] for image_id in expand_with)}
        if companions:
            near = np.sort(_best(cosines, max(self._options.expansion_depth, 2 * count)))
            rows, cosines = rows[near], cosines[near]
            scores = self._cosines(self._expanded(vector, sorted(companions)), rows)
        return [
            # Rounding may take the cosine of a vector with itself above 1.
            Candidate(self._image_ids[rows[i]], min(1.0, float(cosines[i])))
            for i in _best(scores, count)
        ]

    def _shortlist(self, vector: Float32Array, count: int) -> NDArray[np.int64]:
        """Rows of the photos with the nearest codes, in order of arrival."""
        if count >= len(self):
            return np.arange(len(self))
        _, rows = self._codes.search(self._encoder.encode(vector)[np.newaxis], count)
        return np.sort(rows[0])

    def _cosines(self, vector: Float32Array, rows: NDArray[np.int64]) -> Float32Array:
        if len(rows) == 0:
            return np.zeros(0, np.float32)
        selector = faiss.IDSelectorBatch(rows)
        parameters = faiss.SearchParameters()
        parameters.sel = selector
        products, found = self._vectors.search(vector[np.newaxis], len(rows), params=parameters)
        peaks = np.array([self._peaks[row] for row in rows], np.float32)
        cosines: Float32Array = products[0][np.argsort(found[0])] * peaks
        return cosines

    def _expanded(self, vector: Float32Array, rows: Iterable[int]) -> Float32Array:
        wider: Float32Array = vector.copy()
        for row in rows:
            other = self.vector(self._image_ids[row])
            wider += max(0.0, float(vector @ other)) * other
        return wider


def _best(cosines: Float32Array, count: int) -> NDArray[np.intp]:
    """Indices of the ``count`` highest; ties by index."""
    return np.argsort(-cosines, kind="stable")[:count]


class _SignEncoder:
    """Vector → the signs of its random rotation.

    It is rotated as a matrix, from the left and from the right: a full rotation of 16 384 numbers
    would take 1 GB and as long as comparing with thousands of photos.
    """

    def __init__(self, dimension: int) -> None:
        generator = np.random.default_rng(0)
        num_rows = -(-dimension // _COLUMNS)
        self._padding = num_rows * _COLUMNS - dimension
        # Without flips a matrix of positive numbers has about rank 1, and its signs are alike.
        self._flips = generator.choice([-1, 1], dimension).astype(np.float32)
        self._left = _rotation(generator, max(num_rows, _CODE_ROWS))[:_CODE_ROWS, :num_rows]
        self._right = _rotation(generator, _COLUMNS)

    def encode(self, vector: Float32Array) -> Uint8Array:
        """(dimension,) → (_CODE_ROWS * _COLUMNS / 8,) uint8, 8 signs in each."""
        matrix = np.pad(vector * self._flips, (0, self._padding)).reshape(-1, _COLUMNS)
        return np.packbits(self._left @ matrix @ self._right > 0)


def _rotation(generator: np.random.Generator, size: int) -> Float32Array:
    """A random (size, size) rotation or reflection."""
    rotation, _ = np.linalg.qr(generator.normal(size=(size, size)))
    return rotation.astype(np.float32)
