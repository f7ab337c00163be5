"""The measure of an index as it grows, and its script."""

from __future__ import annotations

import subprocess
import sys

import pytest
from helpers.locations import SCRIPTS

from sfm_front.errors import ConfigError
from sfm_front.evaluation.retrieval import growing_index
from sfm_front.evaluation.retrieval.growing_index import measure_index
from sfm_front.retrieval.index import CosineIndex
from sfm_front.retrieval.retriever import RetrievalOptions

SCRIPT = SCRIPTS / "benchmark_index.py"


def test_a_small_index_is_exact():
    told = []
    small, large = measure_index([60, 30], 4, 200, note=told.append)
    assert [small, large] == told
    assert (small.num_photos, large.num_photos) == (30, 60)
    # Vectors are kept at 8 bits a number: of two that are as near, another one may be the last.
    assert min(small.recall, large.recall) > 0.95
    assert 0 < small.median_seconds <= small.worst_seconds


def test_what_is_not_found_counts(monkeypatch):
    class Forgetful(CosineIndex):
        def query(self, vector, count, **options):
            found = super().query(vector, count, **options)
            return [candidate for candidate in found if candidate.image_id != found[0].image_id]

    monkeypatch.setattr(growing_index, "CosineIndex", Forgetful)
    (cost,) = measure_index([40], 3, 200, options=RetrievalOptions(candidates=4))
    assert cost.recall == pytest.approx(3 / 4, abs=0.1)


@pytest.mark.parametrize(("sizes", "num_queries"), [([], 1), ([0], 1), ([10], 0)])
def test_there_must_be_something_to_ask(sizes, num_queries):
    with pytest.raises(ConfigError, match="must be at least 1"):
        measure_index(sizes, num_queries, 100)


def test_the_script_has_a_line_for_each_size():
    done = subprocess.run(
        [sys.executable, SCRIPT, "--photos", "40", "20", "--queries", "2", "--points", "100"],
        capture_output=True,
        text=True,
        check=True,
    )
    lines = done.stdout.splitlines()
    assert [line.split()[0] for line in lines] == ["photos", "20", "40"]
    assert float(lines[2].split()[4]) > 0.9


def test_the_script_refuses_what_it_cannot_measure():
    done = subprocess.run(
        [sys.executable, SCRIPT, "--photos", "0"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "must be at least 1" in done.stderr
