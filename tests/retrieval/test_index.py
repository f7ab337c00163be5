"""The growing cosine index against sorting all cosines."""

from __future__ import annotations

import numpy as np
import pytest

from sfm_front.errors import ConfigError
from sfm_front.features.global_descriptors.unit_vectors import unit_length
from sfm_front.retrieval.index import CosineIndex, IndexOptions

DIMENSION = 1000
SHORTLIST = IndexOptions().shortlist
COSINE_TOLERANCE = 5e-3  # 8 bits a number


def random_vectors(count: int, dimension: int = DIMENSION) -> np.ndarray:
    rng = np.random.default_rng(count)
    return unit_length(rng.normal(size=(count, dimension)).astype(np.float32))


def index_of(vectors: np.ndarray, **options: float) -> CosineIndex:
    index = CosineIndex(vectors.shape[1], IndexOptions(**options))
    for image_id, vector in enumerate(vectors):
        index.add(image_id, vector)
    return index


def spread_around(centre: np.ndarray, count: int) -> np.ndarray:
    """Vectors whose cosine with the centre falls from 1 to 0 in equal steps."""
    across = random_vectors(count, len(centre))
    across = unit_length(across - np.outer(across @ centre, centre))
    cosines = np.linspace(1, 0, count, dtype=np.float32)[:, np.newaxis]
    return cosines * centre + np.sqrt(1 - cosines**2) * across


@pytest.mark.parametrize("count", [1, 2, SHORTLIST])
def test_the_nearest_come_first(count):
    query = random_vectors(7)[3]
    vectors = spread_around(query, count)
    order = np.random.default_rng(0).permutation(count)
    index = CosineIndex(DIMENSION)
    for number in order:
        index.add(1000 - number, vectors[number])
    assert len(index) == count
    found = index.query(query, 10)
    assert [candidate.image_id for candidate in found] == [1000 - i for i in range(min(count, 10))]
    np.testing.assert_allclose(
        [candidate.cosine for candidate in found],
        (vectors @ query)[:10],
        atol=COSINE_TOLERANCE,
    )
    assert all(candidate.inliers is None for candidate in found)


def test_of_many_the_nearest_come_first_too():
    query = random_vectors(7)[3]
    vectors = np.concatenate([random_vectors(4 * SHORTLIST), spread_around(query, 100)])
    found = index_of(vectors).query(query, 25)
    assert [candidate.image_id for candidate in found] == list(range(4 * SHORTLIST, len(vectors)))[
        :25
    ]


def test_as_many_as_asked_for_are_found():
    vectors = random_vectors(2 * SHORTLIST)
    found = index_of(vectors).query(vectors[5], len(vectors))
    assert sorted(candidate.image_id for candidate in found) == list(range(len(vectors)))
    exact = vectors @ vectors[5]
    np.testing.assert_allclose(
        [candidate.cosine for candidate in found],
        [exact[candidate.image_id] for candidate in found],
        atol=COSINE_TOLERANCE,
    )


def test_vectors_without_negative_numbers_are_told_apart():
    """Those of networks: all lie in one corner of space."""
    rng = np.random.default_rng(0)
    vectors = unit_length(rng.uniform(0, 1, (4 * SHORTLIST, DIMENSION)).astype(np.float32))
    index = index_of(vectors)
    for number in range(0, len(vectors), 100):
        assert index.query(vectors[number], 1)[0].image_id == number


def test_what_is_added_later_is_found_too():
    index = CosineIndex(DIMENSION)
    for number, vector in enumerate(random_vectors(2 * SHORTLIST)):
        index.add(number, vector)
        (best,) = index.query(vector, 1)
        assert best.image_id == number
        assert best.cosine == pytest.approx(1, abs=COSINE_TOLERANCE)


@pytest.mark.parametrize("dimension", [0, 4])
def test_an_empty_index_has_no_answer(dimension):
    assert CosineIndex(dimension).query(np.zeros(dimension, np.float32), 5) == []


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
    query = np.array([1, 0], np.float32)
    assert index.query(query, 1)[0].cosine == pytest.approx(1, abs=COSINE_TOLERANCE)


def test_a_vector_of_zeros_is_like_no_other():
    index = index_of(np.array([[0, 0], [1, 0]], np.float32))
    found = index.query(np.array([1, 0], np.float32), 2)
    assert [candidate.image_id for candidate in found] == [1, 0]
    assert found[1].cosine == pytest.approx(0, abs=COSINE_TOLERANCE)


def test_a_widened_query_is_the_sum_with_its_best():
    vectors = spread_around(random_vectors(7)[3], 40)
    query = vectors[20]
    exact = vectors @ query
    best = np.argsort(-exact)[:3]
    wide = unit_length(query + exact[best] @ vectors[best])
    expected = vectors @ wide
    found = index_of(vectors).query(query, 40, num_expansion=3)
    order = [candidate.image_id for candidate in found]
    assert sorted(order) == list(range(40))
    np.testing.assert_allclose(expected[order], np.sort(expected)[::-1], atol=COSINE_TOLERANCE)
    # What is told is how alike the two photos are.
    np.testing.assert_allclose(
        [candidate.cosine for candidate in found], exact[order], atol=COSINE_TOLERANCE
    )
    assert order != np.argsort(-exact).tolist()


def test_a_query_widened_with_photos_is_the_sum_with_those():
    vectors = spread_around(random_vectors(7)[3], 40)
    query, chosen = vectors[20], [3, 31]
    exact = vectors @ query
    wide = query + exact[chosen] @ vectors[chosen]
    found = index_of(vectors).query(query, 40, expand_with=chosen)
    order = [candidate.image_id for candidate in found]
    expected = vectors @ unit_length(wide)
    np.testing.assert_allclose(expected[order], np.sort(expected)[::-1], atol=COSINE_TOLERANCE)
    assert order != np.argsort(-exact).tolist()


def test_a_longer_shortlist_finds_more_of_the_nearest():
    vectors = random_vectors(4 * SHORTLIST)
    nearest = np.argsort(-(vectors @ vectors[5]))[:10]
    exhaustive, brief = (
        {
            c.image_id
            for c in index_of(vectors, shortlist=shortlist, shortlist_growth=0).query(
                vectors[5], 10
            )
        }
        for shortlist in (len(vectors), 1)
    )
    assert exhaustive == set(nearest)
    assert not exhaustive <= brief


@pytest.mark.parametrize(
    ("num_photos", "compared"), [(100, 100), (200, 198), (10_000, 1400), (1_000_000, 14_000)]
)
def test_more_photos_have_more_of_them_compared(num_photos, compared):
    assert IndexOptions().num_compared(num_photos, 25) == compared


def test_the_nearest_are_found_among_many_that_are_as_near_as_each_other():
    """What most have in common hides how they differ: only a longer shortlist finds those."""
    common = np.full(DIMENSION, 0.8 / np.sqrt(DIMENSION))
    vectors = unit_length((common + random_vectors(16 * SHORTLIST)).astype(np.float32))
    queries = unit_length((common + random_vectors(20)).astype(np.float32))
    recalls = []
    for growth in (0.0, IndexOptions().shortlist_growth):
        index = index_of(vectors, shortlist_growth=growth)
        found = [{c.image_id for c in index.query(query, 25)} for query in queries]
        nearest = np.argsort(-(queries @ vectors.T), axis=1)[:, :25]
        recalls.append(np.mean([len(f & set(n)) / 25 for f, n in zip(found, nearest, strict=True)]))
    assert recalls[0] < recalls[1]
    assert recalls[1] > 0.97


@pytest.mark.parametrize(("depth", "reordered"), [(1, 20), (30, 30)])
def test_an_expanded_query_orders_just_the_nearest(depth, reordered):
    """Expanded with the photo least like the query, which puts those like that one first."""
    vectors = spread_around(random_vectors(7)[3], 40)
    query = vectors[15]
    exact = vectors @ query
    found = index_of(vectors, expansion_depth=depth).query(query, 10, expand_with=[0])
    expanded = vectors @ (query + exact[0] * vectors[0])
    near = np.argsort(-exact)[:reordered]
    assert [c.image_id for c in found] == near[np.argsort(-expanded[near])][:10].tolist()


@pytest.mark.parametrize("name", ["shortlist", "expansion_depth"])
def test_values_out_of_range_are_refused_by_name(name):
    with pytest.raises(ConfigError, match=f"{name} must be at least 1, got 0"):
        IndexOptions(**{name: 0})


@pytest.mark.parametrize("growth", [-1.0, float("nan"), float("inf")])
def test_a_shortlist_does_not_shrink(growth):
    with pytest.raises(ConfigError, match="shortlist_growth must not be negative"):
        IndexOptions(shortlist_growth=growth)
