"""Vocabulary tree: pycolmap's ``VisualIndex``, learnt on the indexed photos.

Sources: Nister and Stewenius, "Scalable recognition with a vocabulary tree", CVPR 2006;
Schoenberger et al., "A vote-and-verify strategy for fast spatial verification in image retrieval",
ACCV 2016, which describes COLMAP's index: visual words with Hamming embedding, TF-IDF.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pycolmap

from sfm_front.evaluation.retrieval.methods.training import num_words_for, sample_descriptors
from sfm_front.evaluation.retrieval.types import BenchPhoto, Ranked
from sfm_front.geometry.trivial_rigs import trivial_frame, trivial_rig
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.types import Features, Float32Array

DESCRIPTORS_PER_WORD = 100
MOST_WORDS = 2**13
TRAINING_POINTS_PER_WORD = 39
KMEANS_ROUNDS = 6
_SIFT_DIMENSION = 128
_EMBEDDING_DIMENSION = 64


class VocabularyTree:
    """Ranks all photos by COLMAP's score; ``Ranked.score`` is the reciprocal of the rank, because
    pycolmap returns only the order. COLMAP's geometric verification is off.

    The Python binding of ``VisualIndex.query`` drops its result. COLMAP's pair generator queries
    the same index and returns it, but loads the index from a file for each query: ``seconds``
    excludes that.
    """

    name = "vocabulary_tree"
    global_vectors = ()

    def __init__(
        self, *, num_words: int | None = None, seed: int = 0, num_threads: int = 1
    ) -> None:
        """``num_words``: by default, one per ``DESCRIPTORS_PER_WORD`` indexed descriptors.

        ``seed`` draws the descriptors that words are learnt from.
        """
        self._num_words = num_words
        self._seed = seed
        self._num_threads = num_threads
        self.seconds: Mapping[str, float] = {}
        """Seconds of the last query, without loading the index."""

    def build(self, photos: Sequence[BenchPhoto]) -> None:
        num_words = self._num_words or num_words_for(
            photos, per_word=DESCRIPTORS_PER_WORD, most=MOST_WORDS
        )
        points = sample_descriptors(photos, TRAINING_POINTS_PER_WORD * num_words, self._seed)
        index = pycolmap.VisualIndex.create(_SIFT_DIMENSION, _EMBEDDING_DIMENSION)
        index.build(
            pycolmap.VisualIndex.BuildOptions(
                num_visual_words=min(num_words, len(points)),
                num_iterations=KMEANS_ROUNDS,
                num_rounds=1,
                num_threads=self._num_threads,
            ),
            _descriptors(points),
        )
        options = pycolmap.VisualIndex.IndexOptions(num_threads=self._num_threads)
        for photo in photos:
            features = photo.view.features
            # Only verification, which is off, needs their positions.
            keypoints = pycolmap.FeatureKeypoints([pycolmap.FeatureKeypoint()] * len(features))
            index.add(
                options,
                photo.view.image_id,
                keypoints,
                _descriptors(features.descriptors.astype(np.float32)),
            )
        index.prepare()
        self._ids = [photo.view.image_id for photo in photos]
        self._folder = tempfile.TemporaryDirectory(prefix="sfm-front-vocabulary-")
        self._file = Path(self._folder.name) / "index.bin"
        index.write(self._file)

    def rank(self, query: BenchPhoto) -> list[Ranked]:
        clock = Stopwatch()
        # Under an indexed photo's id, so that the query is not added to the index.
        query_id = self._ids[0]
        options = pycolmap.VocabTreePairingOptions(
            num_images=len(self._ids),
            vocab_tree_path=self._file,
            num_threads=self._num_threads,
        )
        with _database_of(query.view.features, query_id) as database:
            generator = pycolmap.VocabTreePairGenerator(options, database, [query_id])
            with clock.stage("query"):
                pairs = generator.next()
        self.seconds = clock.seconds
        found = [image_id for _, image_id in pairs]
        ranked = [Ranked(image_id, 1 / place) for place, image_id in enumerate(found, 1)]
        missing = set(self._ids) - set(found)
        return ranked + [Ranked(image_id, 0.0) for image_id in self._ids if image_id in missing]


def _descriptors(points: Float32Array) -> pycolmap.FeatureDescriptorsFloat:
    return pycolmap.FeatureDescriptorsFloat(type=pycolmap.FeatureExtractorType.SIFT, data=points)


def _database_of(features: Features, image_id: int) -> pycolmap.Database:
    """An in-memory database with the minimum that COLMAP needs to query one photo."""
    database = pycolmap.Database.open(":memory:")
    camera = pycolmap.Camera.create_from_model_name(1, "SIMPLE_PINHOLE", 1.0, 1, 1)
    image = pycolmap.Image(name="query", camera_id=1, image_id=image_id)
    database.write_camera(camera, use_camera_id=True)
    database.write_rig(trivial_rig(camera), use_rig_id=True)
    database.write_image(image, use_image_id=True)
    database.write_frame(trivial_frame(image), use_frame_id=True)
    database.write_keypoints(image_id, features.keypoints)
    database.write_descriptors(
        image_id,
        pycolmap.FeatureDescriptors(
            type=pycolmap.FeatureExtractorType.SIFT, data=features.descriptors
        ),
    )
    return database
