"""Learn a codebook from the features of many photos."""

from __future__ import annotations

from collections.abc import Sequence

import faiss
import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.features.global_descriptors.codebook import SIFT_DIMENSION, Codebook, Float16Array
from sfm_front.features.global_descriptors.visual_words import VisualWords
from sfm_front.types import Features, Float32Array, Float64Array, Uint8Array

KMEANS_ROUNDS = 25
KMEANS_POINTS_PER_WORD = 400
"""With more descriptors per word than this, k-means learns from a sample."""

DAMPING = 0.2
"""Added to the variances that whitening divides by, as a share of their mean: few photos estimate
weak directions badly. Its value matters little (TUNING: codebook-damping)."""


def train_codebook(
    photos: Sequence[Features],
    *,
    num_words: int,
    dimension: int,
    per_photo: int = 400,
    seed: int = 0,
) -> Codebook:
    """Features of many photos → Codebook; the same for the same input and seed.

    Projection and words are learnt from ``per_photo`` random descriptors per photo, the whitening
    from the summed residuals of each whole photo at each word.

    Raises:
        ConfigError: sizes out of range, or fewer descriptors than words.
    """
    if not 1 <= dimension <= SIFT_DIMENSION:
        raise ConfigError(f"dimension must be 1 to {SIFT_DIMENSION}, got {dimension}")
    descriptors = _draw([photo.descriptors for photo in photos], per_photo, seed)
    if not 1 <= num_words <= len(descriptors):
        raise ConfigError(
            f"num_words must be 1 to the number of descriptors ({len(descriptors)}), "
            f"got {num_words}"
        )
    mean, projection = map(_shipped, _principal_axes(descriptors, dimension))
    origin = np.zeros((1, dimension), np.float16)
    projected = VisualWords(mean, projection, origin).project(descriptors)
    words = _shipped(_cluster(projected, num_words, seed))
    whitening = _shipped(_whitening(VisualWords(mean, projection, words), photos))
    return Codebook(mean, projection, words, whitening)


def _shipped(array: NDArray[np.floating]) -> Float16Array:
    return array.astype(np.float16)


def _draw(descriptors: Sequence[Uint8Array], per_photo: int, seed: int) -> Uint8Array:
    generator = np.random.default_rng(seed)
    drawn = [rows[generator.permutation(len(rows))[:per_photo]] for rows in descriptors]
    return np.concatenate([np.zeros((0, SIFT_DIMENSION), np.uint8), *drawn])


def _principal_axes(descriptors: Uint8Array, dimension: int) -> tuple[Float32Array, Float32Array]:
    """Mean (128,) of the descriptors, and the projection (128, dimension) onto their strongest
    principal components, each divided by the square root of its standard deviation.

    This is half a whitening: without it, the strong components alone decide which word is nearest;
    a full one amplifies the noise of the weak ones.
    """
    points = descriptors.astype(np.float32)
    mean: Float32Array = points.mean(axis=0)
    points -= mean
    # eigh sorts by rising variance.
    variances, axes = np.linalg.eigh((points.T @ points).astype(np.float64) / len(points))
    strongest = slice(None, -dimension - 1, -1)
    deviations = np.sqrt(np.maximum(variances[strongest], 1e-9))
    return mean, (axes[:, strongest] / np.sqrt(deviations)).astype(np.float32)


def _cluster(points: Float32Array, num_words: int, seed: int) -> Float32Array:
    """(N, d) → (num_words, d) cluster centres."""
    kmeans = faiss.Kmeans(
        points.shape[1],
        num_words,
        niter=KMEANS_ROUNDS,
        seed=seed,
        max_points_per_centroid=KMEANS_POINTS_PER_WORD,
        min_points_per_centroid=1,
    )
    kmeans.train(np.ascontiguousarray(points))
    return np.asarray(kmeans.centroids, np.float32)


def _whitening(words: VisualWords, photos: Sequence[Features]) -> Float64Array:
    """(k, d, d): for each word, the inverse Cholesky factor of the second moments of the photos'
    directions there.

    Second moments, not covariances: what all photos have in common at a word is its strongest
    direction and distinguishes them least.
    """
    moments = np.zeros((words.count, words.dimension, words.dimension))
    for photo in photos:
        directions = words.directions(photo)
        moments += directions[:, :, np.newaxis] * directions[:, np.newaxis]
    moments /= len(photos)
    # The directions have length 1: their mean variance is 1 / dimension.
    damping = DAMPING / words.dimension * np.eye(words.dimension)
    factors = np.linalg.cholesky(moments + damping)
    inverses: Float64Array = np.tril(np.linalg.inv(factors))
    return inverses
