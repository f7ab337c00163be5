"""The visual words of VLAD: learnt once from a collection, then shipped as a small file."""

from __future__ import annotations

import hashlib
import zipfile
from dataclasses import dataclass
from pathlib import Path

import faiss
import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import ConfigError, InputError
from sfm_front.types import Uint8Array

SIFT_DIMENSION = 128
SHIPPED_CODEBOOK = Path(__file__).with_name("vlad_codebook.npz")

KMEANS_ROUNDS = 25
KMEANS_POINTS_PER_WORD = 400
"""Beyond this many descriptors a word, k-means learns from a sample."""

Float16Array = NDArray[np.float16]


@dataclass(frozen=True, slots=True, eq=False)
class Codebook:
    """What VLAD needs to know of SIFT descriptors, float16 because it ships with the package.

    ``mean`` (128,) is subtracted from a descriptor, ``projection`` (128, d) reduces and whitens
    what remains, ``words`` (k, d) are the centres of the clusters there.
    """

    mean: Float16Array
    projection: Float16Array
    words: Float16Array

    def __post_init__(self) -> None:
        """Raises ConfigError if the shapes do not fit each other."""
        dimension = self.words.shape[-1]
        shapes = (self.mean.shape, self.projection.shape, self.words.ndim)
        if shapes != ((SIFT_DIMENSION,), (SIFT_DIMENSION, dimension), 2):
            raise ConfigError(
                f"a codebook of shapes {self.mean.shape}, {self.projection.shape}, "
                f"{self.words.shape} is none: (128,), (128, d), (k, d) fit each other"
            )

    @property
    def fingerprint(self) -> str:
        """Eight hexadecimal digits; vectors made with codebooks that differ in them are strangers
        to each other."""
        digest = hashlib.sha256()
        for array in (self.mean, self.projection, self.words):
            digest.update(repr(array.shape).encode())
            digest.update(np.ascontiguousarray(array, "<f2").tobytes())
        return digest.hexdigest()[:8]

    def save(self, file: Path) -> None:
        """Write the ``.npz`` that ``load`` reads."""
        with file.open("wb") as stream:
            np.savez_compressed(
                stream, mean=self.mean, projection=self.projection, words=self.words
            )

    @classmethod
    def load(cls, file: Path = SHIPPED_CODEBOOK) -> Codebook:
        """Raises InputError if ``file`` is no codebook."""
        try:
            with np.load(file, allow_pickle=False) as arrays:
                return cls(*(arrays[name] for name in ("mean", "projection", "words")))
        except (
            OSError,
            ValueError,
            TypeError,
            KeyError,
            EOFError,
            zipfile.BadZipFile,
            ConfigError,
        ) as error:
            raise InputError(
                f"{file}: not a VLAD codebook. Make one with scripts/make_vlad_codebook.py."
            ) from error


def train_codebook(
    descriptors: Uint8Array, *, num_words: int, dimension: int, seed: int = 0
) -> Codebook:
    """(N, 128) uint8 RootSIFT of many photos → Codebook; the same for the same input and seed.

    Projects on the ``dimension`` strongest principal components, each divided by the square root
    of its standard deviation: half of a whitening. None of it lets the strong components decide
    alone, all of it lifts the noise of the weak ones.

    Raises:
        ConfigError: sizes out of range, or fewer descriptors than words.
    """
    if not 1 <= dimension <= SIFT_DIMENSION:
        raise ConfigError(f"dimension must be 1 to {SIFT_DIMENSION}, got {dimension}")
    if not 1 <= num_words <= len(descriptors):
        raise ConfigError(
            f"num_words must be 1 to the number of descriptors ({len(descriptors)}), "
            f"got {num_words}"
        )
    points = descriptors.astype(np.float32)
    mean = points.mean(axis=0)
    points -= mean
    # eigh sorts by rising variance.
    variances, axes = np.linalg.eigh((points.T @ points).astype(np.float64) / len(points))
    strongest = slice(None, -dimension - 1, -1)
    deviations = np.sqrt(np.maximum(variances[strongest], 1e-9))
    projection = (axes[:, strongest] / np.sqrt(deviations)).astype(np.float32)
    projected = np.ascontiguousarray(points @ projection)
    kmeans = faiss.Kmeans(
        dimension,
        num_words,
        niter=KMEANS_ROUNDS,
        seed=seed,
        max_points_per_centroid=KMEANS_POINTS_PER_WORD,
        min_points_per_centroid=1,
    )
    kmeans.train(projected)
    return Codebook(
        mean.astype(np.float16),
        projection.astype(np.float16),
        np.asarray(kmeans.centroids, np.float16),
    )
