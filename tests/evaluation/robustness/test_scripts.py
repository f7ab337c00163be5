"""The scripts of the robustness benchmarks, as they are run."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import pytest
from helpers.locations import SAMPLES, SCRIPTS, VILLAGE


def run(script, *arguments, cwd):
    return subprocess.run(
        [sys.executable, SCRIPTS / script, *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize(
    ("script", "arguments", "message"),
    [
        ("benchmark_sparse.py", ["--thinnings", "half,tenth"], "tenth unknown; there are whole"),
        ("benchmark_sparse.py", ["--scenes", "vilage"], "did you mean village?"),
        ("benchmark_sparse.py", ["--threads", "0"], "threads must be at least 1"),
        ("benchmark_orders.py", ["--arrangements", "name,reversed"], "no arrangement reversed"),
        ("benchmark_orders.py", ["--scenes", "vilage"], "did you mean village?"),
    ],
)
def test_mistakes_end_in_one_line(tmp_path, script, arguments, message):
    done = run(script, *arguments, "--data", SAMPLES, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.fixture
def data(tmp_path):
    """A scene of four photos of the village."""
    images = tmp_path / "data" / "few" / "images"
    images.mkdir(parents=True)
    for photo in sorted((VILLAGE / "images").iterdir())[:4]:
        shutil.copy(photo, images)
    shutil.copytree(VILLAGE / "gt", images.parent / "gt")
    return images.parents[1]


@pytest.mark.slow
def test_ours_is_compared_with_a_rival_that_is_kept(data):
    arguments = ("--data", "data", "--cache", "cache", "--rivals", "rivals", "--thinnings", "whole")
    arguments += ("--json", "all.json", "--landmarks", "few")
    done = run("benchmark_sparse.py", *arguments, cwd=data.parent)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("| scene | whole |\n| --- | --- |\n| few | 4: 4 4 4 |")
    assert "landmarks, few, whole: COLMAP 0, ours 0, 0, 0." in done.stdout
    (one,) = json.loads((data.parent / "all.json").read_text(encoding="utf-8"))["comparisons"]
    assert (one["photos"], one["rival"]["registered"], one["misses"]) == (4, 4, [])
    assert one["ours"]["shuffle-2"]["quality"]["auc"][2] > 0.9
    assert (data.parent / "rivals" / "few" / "whole" / "sparse" / "0").is_dir()


@pytest.mark.slow
def test_orders_are_compared(data):
    arguments = ("--data", "data", "--cache", "cache", "--arrangements", "shuffle-3,half-flights")
    done = run("benchmark_orders.py", *arguments, "--json", "all.json", cwd=data.parent)
    assert done.returncode == 0, done.stderr
    rows = [line.split(" | ") for line in done.stdout.splitlines()[2:]]
    assert [row[0] for row in rows] == ["| shuffle-3", "| half-flights", "| worst", "| best"]
    assert rows[0][1].startswith("4, ")
    assert rows[-1] == ["| best", rows[0][1]]
    trials = json.loads((data.parent / "all.json").read_text(encoding="utf-8"))["trials"]
    assert [trial["photos"] for trial in trials] == [4, 2]
