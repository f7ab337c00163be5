"""The retrieval benchmark: what is judged and timed, as a table and as a chart."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.bench_photos import ByNumber, bench_photo, query
from PIL import Image

from sfm_front.errors import InputError
from sfm_front.evaluation.retrieval import chart, table
from sfm_front.evaluation.retrieval.average_precision import Accuracy
from sfm_front.evaluation.retrieval.benchmark import Outcome, benchmark
from sfm_front.evaluation.retrieval.material import Material, key_of
from sfm_front.evaluation.retrieval.types import Dataset


@pytest.fixture
def judged():
    """Two datasets over photos 1 to 4: the second asks the first's queries and expects more."""
    paths = {name: Path(name) for name in "abcd"}
    first = (query("a", "a", ["b"]), query("b", "b", ["a"]))
    second = (query("a", "a", ["b", "c"]), query("c", "c", []))
    rng = np.random.default_rng(0)
    chosen = [bench_photo(number, np.ones(1, np.float32), rng) for number in range(1, 5)]
    keys = {key_of(q): chosen["abcd".index(q.photo)] for q in (*first, *second)}
    return Material(
        (Dataset("first", paths, first), Dataset("second", paths, second)),
        chosen,
        dict(zip([1, 2, 3, 4], "abcd", strict=True)),
        keys,
    )


def test_each_query_is_asked_once_and_judged_by_every_dataset(judged):
    # Photo 99 is a distractor, which nobody asked for.
    method = ByNumber({1: [1, 99, 2, 3], 2: [2, 1], 3: [4]}, {"coarse": 0.25, "fine": 0.5})
    notes = []
    first, second = benchmark(method, judged, notes.append)
    assert sorted(method.asked) == [1, 2, 3]
    assert method.built == first.indexed == 4
    assert first.accuracy.mean_average_precision == pytest.approx((0.25 + 1) / 2)
    assert first.accuracy.first_right == 0.5
    assert second.accuracy.num_queries == 1
    assert second.accuracy.mean_average_precision == pytest.approx((0.25 + 7 / 12) / 2)
    assert first.seconds >= 0.01
    assert first.stage_seconds == {"coarse": 0.25, "fine": 0.5}
    assert [note.split(":")[0] for note in notes] == ["first, by number", "second, by number"]


def test_a_query_that_cannot_be_described_finds_nothing(judged):
    keys = {key: photo for key, photo in judged.queries.items() if key[0] != "b"}
    method = ByNumber({1: [2], 3: [4]})
    first, _ = benchmark(method, replace(judged, queries=keys), lambda _: None)
    assert first.accuracy.num_queries == 2
    assert first.accuracy.mean_average_precision == 0.5
    assert first.stage_seconds == {}


def outcome(dataset, method, seconds, precision, **stages):
    accuracy = Accuracy(9, precision, 0.5, {5: 0.25, 10: 0.5, 25: 1.0})
    return Outcome(dataset, method, 100, accuracy, seconds, stages, 0.0)


@pytest.fixture
def outcomes():
    return [
        outcome("holidays", "vlad", 0.00025, 0.75),
        outcome("holidays", "ours", 0.125, 0.9375, coarse=0.0005, fine=0.12),
        replace(outcome("pool", "ours", 0.25, 0.5), accuracy=None),
    ]


def test_the_table_has_a_row_a_dataset_and_measure(outcomes):
    lines = [line.split() for line in table.format_table(outcomes).splitlines()]
    assert lines[0] == ["dataset", "measure", "vlad", "ours"]
    assert lines[2:] == [
        ["holidays", "s/query", "0.0003", "0.1250"],
        ["holidays", "coarse", "s", "-", "0.0005"],
        ["holidays", "fine", "s", "-", "0.1200"],
        ["holidays", "mAP", "0.750", "0.938"],
        ["holidays", "P@1", "0.500", "0.500"],
        ["holidays", "R@5", "0.250", "0.250"],
        ["holidays", "R@10", "0.500", "0.500"],
        ["holidays", "R@25", "1.000", "1.000"],
        [],
        ["pool", "s/query", "-", "0.2500"],
    ]


def test_the_csv_has_every_digit(outcomes, tmp_path):
    table.write_csv(outcomes, tmp_path / "new" / "table.csv")
    with (tmp_path / "new" / "table.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["dataset", "measure", "vlad", "ours"]
    assert rows[1] == ["holidays", "s/query", "0.00025", "0.125"]
    assert rows[2] == ["holidays", "coarse s", "", "0.0005"]
    with pytest.raises(InputError, match="cannot be written"):
        table.write_csv(outcomes, tmp_path)


def test_the_chart_is_written(outcomes, tmp_path):
    pytest.importorskip("matplotlib")
    chart.write_chart(outcomes, tmp_path / "chart.png", highlighted=["ours"])
    assert Image.open(tmp_path / "chart.png").size[0] > 1000
