"""What methods are given: photos and queries, described once."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers.bench_photos import query, small_dataset

from sfm_front.errors import InputError
from sfm_front.evaluation.retrieval.describe import BenchExtraction
from sfm_front.evaluation.retrieval.material import describe, key_of, sampled
from sfm_front.evaluation.retrieval.types import Dataset


@pytest.fixture
def world(tmp_path):
    return small_dataset(tmp_path)


@pytest.fixture
def material(world, tmp_path):
    notes = []
    made = describe(
        [world], BenchExtraction(tmp_path / "cache", {}, max_features=200), notes.append
    )
    return made, notes


def test_photos_and_queries_are_described_once(material, world):
    made, notes = material
    assert sorted(made.names.values()) == ["1_0.png", "1_60.png", "2_0.png", "2_60.png"]
    whole, part, outside, unreadable = map(key_of, world.queries)
    indexed = {made.names[photo.view.image_id]: photo for photo in made.photos}
    assert made.queries[whole] is indexed["1_0.png"]
    assert unreadable not in made.queries
    points = made.queries[part].view.features.keypoints
    assert 0 < len(points) <= len(indexed["1_0.png"].view.features)
    assert made.queries[outside].view.image_id not in made.names
    assert "small: 5 of 5 photos described" in notes
    assert any(note.startswith("broken.png: not an image") for note in notes)


def test_nothing_to_search_is_refused(tmp_path):
    (tmp_path / "broken.png").write_bytes(b"no image")
    dataset = Dataset("bad", {"broken.png": tmp_path / "broken.png"}, ())
    with pytest.raises(InputError, match="bad: none of its 1 photos can be used"):
        describe([dataset], BenchExtraction(tmp_path / "cache", {}), lambda _: None)


def test_nothing_to_ask_is_refused(world, tmp_path):
    last = replace(world, queries=world.queries[-1:])
    with pytest.raises(InputError, match="small: none of its queries can be used"):
        describe([last], BenchExtraction(tmp_path / "cache", {}, max_features=50), lambda _: None)


def test_queries_are_sampled_in_their_order_and_always_the_same():
    queries = tuple(query(str(i), str(i), ["x"]) for i in range(100))
    some = sampled(queries, 10)
    assert len(some) == 10
    assert [int(one.name) for one in some] == sorted(int(one.name) for one in some)
    assert sampled(queries, 10) == some
    assert sampled(queries, None) == sampled(queries, 100) == queries
