"""The growing cosine index against sorting all cosines."""

from __future__ import annotations

import numpy as np
import pytest

from sfm_front.features.vectors import unit_length
from sfm_front.retrieval.index import CosineIndex

COSINE_TOLERANCE = 1e-6  # float32


def random_vectors(count: int, dimension: int = 16) -> np.ndarray:
    rng = np.random.default_rng(count)
    return unit_length(rng.normal(size=(count, dimension)).astype(np.float32))


@pytest.mark.parametrize("count", [1, 64, 65, 300])  # it makes room at 64, 128 and 256
def test_the_nearest_come_first(count):
    vectors = random_vectors(count)
    query = random_vectors(7)[3]
    index = CosineIndex(16)
    for number, vector in enumerate(vectors):
        index.add(1000 - number, vector)
    assert len(index) == count
    cosines = vectors @ query
    order = np.argsort(-cosines)[:10]
    found = index.query(query, 10)
    assert [candidate.image_id for candidate in found] == [1000 - i for i in order]
    np.testing.assert_allclose(
        [candidate.cosine for candidate in found], cosines[order], atol=COSINE_TOLERANCE
    )
    assert all(candidate.inliers is None for candidate in found)


def test_what_is_added_later_is_found_too():
    index = CosineIndex(16)
    vectors = random_vectors(200)
    for number, vector in enumerate(vectors):
        index.add(number, vector)
        (best,) = index.query(vector, 1)
        assert best.image_id == number
        assert best.cosine == pytest.approx(1, abs=COSINE_TOLERANCE)


def test_an_empty_index_has_no_answer():
    assert CosineIndex(4).query(np.ones(4, np.float32) / 2, 5) == []


def test_of_equals_the_earlier_comes_first():
    index = CosineIndex(4)
    vector = np.array([1, 0, 0, 0], np.float32)
    for image_id in (5, 2, 9):
        index.add(image_id, vector)
    assert [candidate.image_id for candidate in index.query(vector, 2)] == [5, 2]


def test_the_index_keeps_its_own_copy():
    index = CosineIndex(2)
    vector = np.array([1, 0], np.float32)
    index.add(1, vector)
    vector[:] = 0, 1
    assert index.query(np.array([1, 0], np.float32), 1)[0].cosine == pytest.approx(1)
