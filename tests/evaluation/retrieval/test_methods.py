"""The rivals and ours: each finds a scene's photos; scores, ties and what each is made of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from helpers import photo_files

from sfm_front.errors import ConfigError
from sfm_front.evaluation.retrieval.describe import BenchExtraction
from sfm_front.evaluation.retrieval.methods import METHODS, make_method
from sfm_front.evaluation.retrieval.methods.bag_of_words import BagOfWords, InvertedFile
from sfm_front.evaluation.retrieval.methods.hierarchical import Hierarchical
from sfm_front.evaluation.retrieval.methods.joined import Joined
from sfm_front.evaluation.retrieval.methods.perceptual import ByPerceptualHash
from sfm_front.evaluation.retrieval.methods.training import (
    FEWEST_WORDS,
    num_words_for,
    sample_descriptors,
)
from sfm_front.evaluation.retrieval.methods.vocabulary_tree import VocabularyTree
from sfm_front.evaluation.retrieval.types import BenchPhoto, Ranked, Staged
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.runtime.worker_pool import WorkerPool

NETWORKS = ("alexnet_fc7", "resnet101_pool5", "mobilenet_v2")
BY_LOCAL_FEATURES = (
    *("vlad", "exhaustive", "bow", "vocabulary_tree"),
    *("multi_vocabulary_tree", "ours"),
)
COSINE_TOLERANCE = 0.01  # The index may store vectors in less than float32.
SAME_SCENE = {"2_0.png", "2_60.png", "2_120.png"}


class World:
    def __init__(self, folder) -> None:
        names = [f"{scene}_{shift}.png" for scene in (1, 2, 3) for shift in (0, 60, 120)]
        paths = photo_files.save(folder / "photos", *names)
        outside = photo_files.save(folder / "outside", "2_30.png")
        describer = BenchExtraction(
            folder / "cache", {"vlad": GlobalDescriptor(local=[Vlad()])}, max_features=400
        )
        self.by_name = describer.photos({path.name: path for path in paths}).photos
        self.photos = list(self.by_name.values())
        self.query = describer.photos({"query": outside[0]}).photos["query"]
        self.names = {photo.view.image_id: name for name, photo in self.by_name.items()}

    def ranking(self, ranked: list[Ranked]) -> list[str]:
        return [self.names[one.image_id] for one in ranked]


@pytest.fixture(scope="module")
def world(tmp_path_factory) -> World:
    return World(tmp_path_factory.mktemp("world"))


@pytest.fixture
def workers() -> Iterator[WorkerPool]:
    with WorkerPool(1) as workers:
        yield workers


def test_every_method_of_the_paper_is_there():
    assert set(METHODS) == {*NETWORKS, *BY_LOCAL_FEATURES, "phash"}


def test_no_such_method(workers):
    with pytest.raises(ConfigError, match="no retrieval method is called 'gist'"):
        make_method("gist", workers)


@pytest.mark.parametrize("name", BY_LOCAL_FEATURES)
def test_photos_of_the_scene_come_first_and_all_are_ranked(world, workers, name):
    method = make_method(name, workers)
    assert method.name == name
    method.build(world.photos)
    ranked = method.rank(world.query)
    assert set(world.ranking(ranked)[:3]) == SAME_SCENE
    assert sorted(world.ranking(ranked)) == sorted(world.by_name)
    scores = [one.score for one in ranked]
    assert scores == sorted(scores, reverse=True)


@pytest.mark.parametrize("name", BY_LOCAL_FEATURES)
def test_an_indexed_query_finds_itself_first(world, workers, name):
    method = make_method(name, workers)
    method.build(world.photos)
    assert world.ranking(method.rank(world.by_name["3_60.png"]))[0] == "3_60.png"


@pytest.mark.parametrize("name", ["bow", "vocabulary_tree", "ours"])
def test_asking_changes_nothing(world, workers, name):
    method = make_method(name, workers)
    method.build(world.photos)
    before = method.rank(world.query)
    for photo in world.photos:
        method.rank(photo)
    assert method.rank(world.query) == before


def test_networks_rank_by_their_own_vectors(world, workers):
    method = make_method("mobilenet_v2", workers)
    assert method.global_vectors == ("mobilenet_v2",)
    axes = np.eye(9, dtype=np.float32)
    photos = [
        replace(photo, vectors={"mobilenet_v2": axis})
        for photo, axis in zip(world.photos, axes, strict=True)
    ]
    method.build(photos)
    ranked = method.rank(replace(world.query, vectors={"mobilenet_v2": axes[4]}))
    assert ranked[0].image_id == photos[4].view.image_id
    assert ranked[0].cosine == pytest.approx(1, abs=COSINE_TOLERANCE)
    assert all(abs(one.cosine) < COSINE_TOLERANCE for one in ranked[1:])


def test_hashes_are_ranked_by_equal_bits(world):
    def hashed(photo: BenchPhoto, *values: int) -> BenchPhoto:
        return replace(photo, perceptual_hash=np.array([*values] + [0] * 6, np.uint8))

    photos = [
        hashed(photo, *values)
        for photo, values in zip(world.photos, [(255, 0), (1, 0), (1, 2)], strict=False)
    ]
    method = ByPerceptualHash()
    method.build(photos)
    ranked = method.rank(hashed(world.query, 1, 0))
    assert [(one.image_id, one.score) for one in ranked] == [
        (photos[1].view.image_id, 1.0),
        (photos[2].view.image_id, 1 - 1 / 64),
        (photos[0].view.image_id, 1 - 7 / 64),
    ]


def test_ours_ranks_what_it_verified_first(world, workers):
    method = Hierarchical(workers, retrieval=RetrievalOptions(candidates=4))
    method.build(world.photos)
    ranked = method.rank(world.query)
    inliers = [one.inliers for one in ranked]
    assert inliers[:3] == sorted(inliers[:3], reverse=True)
    assert inliers[2] >= 15
    assert sum(count is not None for count in inliers) == 4
    scores = [one.score for one in ranked]
    assert scores == sorted(set(scores), reverse=True)
    assert isinstance(method, Staged)
    assert set(method.seconds) == {"coarse", "fine"}


def test_a_tree_without_an_answer_for_a_photo_still_ranks_it(world):
    """A photo that shares no word with the query is not in pycolmap's answer."""
    method = VocabularyTree(num_words=64)
    method.build(world.photos)
    tiny = world.by_name["1_0.png"].view
    features = tiny.features
    few = replace(
        features,
        keypoints=features.keypoints[:1],
        descriptors=features.descriptors[:1],
        colors=features.colors[:1],
    )
    ranked = method.rank(replace(world.query, view=replace(tiny, features=few)))
    assert sorted(world.ranking(ranked)) == sorted(world.by_name)
    assert isinstance(method, Staged)
    assert set(method.seconds) == {"query"}


class Fixed:
    """Ranks the ids it was given."""

    name = "fixed"

    def __init__(self, ids: list[int], *vectors: str) -> None:
        self.ids = ids
        self.global_vectors = vectors
        self.built = 0

    def build(self, photos) -> None:
        self.built = len(photos)

    def rank(self, _query) -> list[Ranked]:
        return [Ranked(image_id, -place) for place, image_id in enumerate(self.ids)]


def test_joined_methods_vote_by_rank(world):
    methods = [Fixed([1, 2, 3], "vlad"), Fixed([2, 1, 3], "vlad", "x"), Fixed([2, 3, 1])]
    joined = Joined("all", methods)
    joined.build(world.photos)
    assert [method.built for method in methods] == [9, 9, 9]
    assert joined.global_vectors == ("vlad", "x")
    ranked = joined.rank(world.query)
    assert [one.image_id for one in ranked] == [2, 1, 3]
    assert ranked[0].score == pytest.approx(2 / 61 + 1 / 62)
    assert set(joined.seconds) == {"fixed 1", "fixed 2", "fixed 3", "vote"}


def test_an_inverted_file_gives_the_cosine_of_tf_idf_vectors():
    """Against the definition, on dense vectors."""
    rng = np.random.default_rng(0)
    num_words = 30
    photos = [rng.integers(0, 25, rng.integers(5, 60)) for _ in range(8)]
    query = rng.integers(0, num_words, 40)
    counts = np.stack([np.bincount(words, minlength=num_words) for words in (*photos, query)])
    in_photos = (counts[:-1] > 0).sum(axis=0)
    dense = counts * (np.log((1 + len(photos)) / (1 + in_photos)) + 1)
    dense /= np.linalg.norm(dense, axis=1, keepdims=True)
    cosines = InvertedFile(photos, num_words).cosines(query)
    np.testing.assert_allclose(cosines, dense[:-1] @ dense[-1], atol=1e-12)


def test_words_of_other_photos_alone_have_cosine_0():
    file = InvertedFile([np.array([0, 0, 1]), np.array([2])], 4)
    np.testing.assert_allclose(file.cosines(np.array([2, 2])), [0, 1])
    np.testing.assert_array_equal(file.cosines(np.array([3])), [0, 0])


def test_a_bag_of_words_has_the_words_it_is_asked_for(world):
    method = BagOfWords(num_words=50)
    method.build(world.photos)
    assert method._words.ntotal == 50


def test_words_are_as_many_as_the_descriptors_call_for(world):
    total = sum(len(photo.view.features) for photo in world.photos)
    assert total > 2 * FEWEST_WORDS
    assert num_words_for(world.photos, per_word=2, most=10**6) == total // 2
    assert num_words_for(world.photos, per_word=2, most=7) == 7
    assert num_words_for(world.photos, per_word=10**9, most=10**6) == FEWEST_WORDS
    assert num_words_for(world.photos[:1], per_word=1000, most=10**6) < FEWEST_WORDS
    with pytest.raises(ConfigError, match="none of the photos has features"):
        num_words_for([], per_word=30, most=7)


def test_a_sample_holds_descriptors_of_all_photos_once(world):
    everything = np.concatenate([photo.view.features.descriptors for photo in world.photos])
    whole = sample_descriptors(world.photos, 10**6, 0)
    np.testing.assert_array_equal(whole, everything)
    some = sample_descriptors(world.photos, 500, 0)
    assert some.shape == (500, 128)
    assert some.dtype == np.float32
    known = {row.tobytes() for row in everything.astype(np.float32)}
    assert all(row.tobytes() in known for row in some)
    np.testing.assert_array_equal(some, sample_descriptors(world.photos, 500, 0))
    assert not np.array_equal(some, sample_descriptors(world.photos, 500, 1))
