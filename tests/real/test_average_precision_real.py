"""Average precision on the published annotation files: perfect rankings, and known permutations."""

from __future__ import annotations

import random
from statistics import fmean

import pytest
from helpers.locations import DATA

from sfm_front.evaluation.retrieval.average_precision import assess
from sfm_front.evaluation.retrieval.datasets.holidays import queries_of
from sfm_front.evaluation.retrieval.datasets.oxford import read_queries

FOLDER = DATA / "ground_truth"
EXACT = 1e-12

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not FOLDER.is_dir(), reason="needs ../shared/data"),
]


@pytest.fixture(scope="module")
def oxford():
    return read_queries(FOLDER / "oxford5k")


@pytest.fixture(scope="module")
def holidays():
    return queries_of((FOLDER / "holidays_images.dat").read_text().split())


def everything(queries):
    return sorted({name for q in queries for name in (*q.relevant, *q.ignored, q.photo)})


def trapezoids(places, num_relevant):
    """Area from the places of right answers, counted from 0: the other way to write it."""
    area = 0.0
    for found, place in enumerate(places):
        before = found / place if place else 1.0
        area += (before + (found + 1) / (place + 1)) / (2 * num_relevant)
    return area


def test_oxford_is_read_whole(oxford):
    assert len(oxford) == 55
    assert {query.name.rsplit("_", 1)[0] for query in oxford} == {
        "all_souls", "ashmolean", "balliol", "bodleian", "christ_church", "cornmarket", "hertford",
        "keble", "magdalen", "pitt_rivers", "radcliffe_camera",
    }  # fmt: skip
    first = oxford[0]
    assert (first.name, first.photo) == ("all_souls_1", "all_souls_000013")
    assert first.box == (136.5, 34.1, 648.5, 955.7)
    assert all(query.photo in query.relevant for query in oxford)
    assert not any(query.relevant & query.ignored for query in oxford)


def test_holidays_is_read_whole(holidays):
    assert len(holidays) == 500
    assert sum(1 + len(query.relevant) for query in holidays) == 1491
    assert all(query.ignored == {query.photo} for query in holidays)
    assert holidays[0].relevant == {"100001.jpg", "100002.jpg"}


@pytest.mark.parametrize("dataset", ["oxford", "holidays"])
def test_a_perfect_ranking_is_worth_one(dataset, request):
    queries = request.getfixturevalue(dataset)
    names = everything(queries)
    # Junk before everything, which must not count.
    rankings = [
        sorted(names, key=lambda name, q=query: (name not in q.ignored, name not in q.relevant))
        for query in queries
    ]
    accuracy = assess(rankings, queries)
    assert accuracy.num_queries == len(queries)
    assert accuracy.mean_average_precision == pytest.approx(1, abs=EXACT)
    assert accuracy.first_right == 1


@pytest.mark.parametrize("dataset", ["oxford", "holidays"])
def test_the_worst_ranking_has_its_closed_form(dataset, request):
    """All wrong answers first: with w of them, the i-th right one comes at place w + i."""
    queries = request.getfixturevalue(dataset)
    names = everything(queries)
    rankings = [sorted(names, key=lambda name, q=query: name in q.relevant) for query in queries]
    expected = fmean(
        trapezoids(
            range(wrong := len(names) - len(q.relevant) - len(q.ignored), wrong + len(q.relevant)),
            len(q.relevant),
        )
        for q in queries
    )
    assert 0 < expected < 0.05
    accuracy = assess(rankings, queries)
    assert accuracy.mean_average_precision == pytest.approx(expected, abs=EXACT)
    assert accuracy.first_right == 0


@pytest.mark.parametrize("dataset", ["oxford", "holidays"])
def test_shuffled_rankings_are_worth_what_their_places_say(dataset, request):
    queries = request.getfixturevalue(dataset)
    names = everything(queries)
    rankings, expected = [], []
    for seed, query in enumerate(queries):
        shuffled = random.Random(seed).sample(names, len(names))
        # Right answers drawn forward, so that the value is far from nought.
        shuffled.sort(key=lambda name, q=query: name not in q.relevant and hash_of(name) % 3 > 0)
        junk_before, places = 0, []
        for place, name in enumerate(shuffled):
            junk_before += name in query.ignored
            if name in query.relevant:
                places.append(place - junk_before)
        rankings.append(shuffled)
        expected.append(trapezoids(places, len(query.relevant)))
    found = assess(rankings, queries).mean_average_precision
    assert found == pytest.approx(fmean(expected), abs=EXACT)
    assert 0.001 < found < 0.9


def hash_of(name):
    return sum(map(ord, name))
