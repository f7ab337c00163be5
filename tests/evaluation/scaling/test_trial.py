"""A cluster of this machine beside one process, on a small synthetic flight."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from helpers.locations import SCRIPTS

pytest.importorskip("distributed")
pytest.importorskip("pymetis")

SCRIPT = SCRIPTS / "benchmark_cluster.py"
PHOTOS = 36


def flown(*args: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), "--photos", str(PHOTOS), "--points", "300", *args]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_cluster_places_what_one_process_does(tmp_path):
    file = tmp_path / "figures.json"
    ran = flown("--group-size", "18", "--gps-noise", "3", "--json", str(file))
    assert ran.returncode == 0, ran.stderr
    assert "of 2 groups grown" in ran.stderr  # there was something to join
    figures = json.loads(file.read_text())
    alone, cluster = figures["one process"], figures["local:2"]
    assert alone["num_registered"] == cluster["num_registered"] == PHOTOS
    assert alone["num_models"] == cluster["num_models"] == 1
    # At 3 degrees. So few photos hardly determine the lens: either may be a few points off.
    assert min(alone["auc"][1], cluster["auc"][1]) > 0.9
    assert [line.split("|")[1].strip() for line in ran.stdout.splitlines()[2:]] == [
        "one process",
        "local:2",
    ]


def test_fewer_photos_than_a_group_are_refused():
    ran = flown("--group-size", "40")
    assert ran.returncode == 2
    assert ran.stderr == "benchmark_cluster: --photos must be at least --group-size, got 36\n"
