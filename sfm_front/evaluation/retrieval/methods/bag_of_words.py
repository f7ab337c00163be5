"""Bag of words: visual words learnt on the indexed photos, TF-IDF, cosine by an inverted file.

Sources: Sivic and Zisserman, "Video Google: A text retrieval approach to object matching in
videos", ICCV 2003; Philbin et al., "Object retrieval with large vocabularies and fast spatial
matching", CVPR 2007 (k-means and assignment by approximate nearest neighbours, which makes large
vocabularies affordable).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import faiss
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from sfm_front.evaluation.retrieval.methods.training import num_words_for, sample_descriptors
from sfm_front.evaluation.retrieval.types import BenchPhoto, Ranked
from sfm_front.types import Float32Array, Uint8Array

DESCRIPTORS_PER_WORD = 80
MOST_WORDS = 2**16
TRAINING_POINTS_PER_WORD = 15
KMEANS_ROUNDS = 6
# The graph that finds the nearest word (HNSW): neighbours per node, and nodes held in a search.
_GRAPH_NEIGHBOURS = 16
_GRAPH_BREADTH = 16


class BagOfWords:
    """Ranks all photos by the cosine of their TF-IDF vectors of visual words."""

    name = "bow"
    global_vectors = ()

    def __init__(
        self, *, num_words: int | None = None, seed: int = 0, num_threads: int = 1
    ) -> None:
        """``num_words``: by default, one per ``DESCRIPTORS_PER_WORD`` indexed descriptors."""
        self._num_threads = num_threads
        self._num_words = num_words
        self._seed = seed

    def build(self, photos: Sequence[BenchPhoto]) -> None:
        num_words = self._num_words or num_words_for(
            photos, per_word=DESCRIPTORS_PER_WORD, most=MOST_WORDS
        )
        points = sample_descriptors(photos, TRAINING_POINTS_PER_WORD * num_words, self._seed)
        with threadpool_limits(self._num_threads):
            self._words = learn_words(points, min(num_words, len(points)), self._seed)
        self._ids = [photo.view.image_id for photo in photos]
        self._file = InvertedFile(
            [self._words_of(photo.view.features.descriptors) for photo in photos],
            self._words.ntotal,
        )

    def rank(self, query: BenchPhoto) -> list[Ranked]:
        cosines = self._file.cosines(self._words_of(query.view.features.descriptors))
        order = np.argsort(-cosines, kind="stable")
        return [Ranked(self._ids[i], float(cosines[i]), cosine=float(cosines[i])) for i in order]

    def _words_of(self, descriptors: Uint8Array) -> NDArray[np.int64]:
        with threadpool_limits(self._num_threads, "openmp"):
            _, words = self._words.search(descriptors.astype(np.float32), 1)
        found: NDArray[np.int64] = words[:, 0]
        return found


def learn_words(points: Float32Array, num_words: int, seed: int) -> Any:
    """(n, 128) float32 → a faiss index that finds the nearest of ``num_words`` words."""
    words = faiss.IndexHNSWFlat(points.shape[1], _GRAPH_NEIGHBOURS)
    words.hnsw.efSearch = _GRAPH_BREADTH
    clustering = faiss.Clustering(points.shape[1], num_words)
    clustering.niter = KMEANS_ROUNDS
    clustering.seed = seed
    clustering.min_points_per_centroid = 1
    clustering.train(points, words)
    return words


class InvertedFile:
    """For each word, the photos with it and its weight there."""

    def __init__(self, words_of_photos: Sequence[NDArray[np.int64]], num_words: int) -> None:
        """``words_of_photos``: the word of each descriptor of each photo."""
        self._num_photos = len(words_of_photos)
        counted = [np.unique(words, return_counts=True) for words in words_of_photos]
        in_photos = np.bincount(
            np.concatenate([words for words, _ in counted]), minlength=num_words
        )
        # A query may have a word that no photo has; it only adds to the query's length.
        self._idf = np.log((1 + self._num_photos) / (1 + in_photos)) + 1
        word = np.concatenate([words for words, _ in counted])
        photo = np.repeat(np.arange(len(counted)), [len(words) for words, _ in counted])
        weight = np.concatenate([self._weights(words, counts) for words, counts in counted])
        order = np.argsort(word, kind="stable")
        self._photos = photo[order]
        self._weights_by_word = weight[order]
        self._starts = np.concatenate([[0], np.cumsum(in_photos)])

    def cosines(self, words: NDArray[np.int64]) -> NDArray[np.float64]:
        """The word of each descriptor of a query → its cosine with each photo."""
        distinct, counts = np.unique(words, return_counts=True)
        lengths = self._starts[distinct + 1] - self._starts[distinct]
        # The positions in each word's run, one run after the other.
        places = np.arange(lengths.sum()) + np.repeat(
            self._starts[distinct] - (np.cumsum(lengths) - lengths), lengths
        )
        products = self._weights_by_word[places] * np.repeat(
            self._weights(distinct, counts), lengths
        )
        sums = np.bincount(self._photos[places], products, minlength=self._num_photos)
        return sums.astype(np.float64)

    def _weights(self, words: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
        """A photo's TF-IDF at length 1, so that its number of words cancels."""
        weights = counts * self._idf[words]
        unit: NDArray[np.float64] = weights / max(float(np.linalg.norm(weights)), 1e-12)
        return unit
