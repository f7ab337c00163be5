"""The reconstruction benchmark: whose turn it is, its settings and its script."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.benchmark_folder import SETTINGS, fake_command, noise_photos
from helpers.locations import SCRIPTS

from sfm_front.errors import ConfigError
from sfm_front.evaluation.reconstruction import benchmark
from sfm_front.evaluation.reconstruction.benchmark import OURS, SIFT_ALONE, benchmark_scene
from sfm_front.evaluation.reconstruction.scenes import find_scene
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings, Run

SCRIPT = SCRIPTS / "benchmark_reconstruction.py"


@pytest.fixture
def photos(tmp_path):
    return noise_photos(tmp_path / "scene" / "images")


def test_methods_take_turns_and_leave_nothing(tmp_path, photos, monkeypatch):
    seeds = []

    def rival(name, _, folder, settings):
        seeds.append(settings.seed)
        folder.mkdir(parents=True)
        return Run(wall_seconds=7.0, peak_memory_bytes=None, failure=f"{name} broke")

    def alone(_, folder, __):
        folder.mkdir(parents=True)
        return 0.5

    monkeypatch.setattr(benchmark, "run_rival", rival)
    monkeypatch.setattr(benchmark, "sift_alone_seconds", alone)
    notes = []
    scene = find_scene(photos)
    arguments = {
        "ours": fake_command(tmp_path),
        "runs": 2,
        "workspace": tmp_path / "w",
        "note": notes.append,
    }
    rows = benchmark_scene(scene, ["spatial"], SETTINGS, keep=False, **arguments)
    assert [row.method for row in rows] == [SIFT_ALONE, OURS, "spatial"]
    assert [note.split(", ")[2].split(":")[0] for note in notes] == 2 * [
        SIFT_ALONE,
        OURS,
        "spatial",
    ]
    assert seeds == [0, 1]
    assert not list((tmp_path / "w").rglob("*.json"))
    assert rows[1].means()["registered"] == 3
    assert rows[2].failures == ("spatial broke",)
    json.dumps([row.as_dict() for row in rows])
    kept = benchmark_scene(scene, [], SETTINGS, keep=True, **arguments)
    assert all(
        Path(folder).is_dir() for run in kept[1].as_dict()["runs"] for folder in run["models"]
    )
    assert all(run["models"] for run in kept[1].as_dict()["runs"])


@pytest.mark.parametrize("wrong", [{"threads": 0}, {"max_features": 0}, {"camera_mode": "one"}])
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(ConfigError, match="got"):
        BenchmarkSettings(**{"threads": 1, **wrong})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--rivals", "exhaustive,psychic"], "psychic unknown"),
        (["--runs", "0"], "--runs must be at least 1"),
        (["--keep", "."], "not empty"),
        (["--gt", "nowhere"], "no COLMAP model"),
    ],
)
def test_the_script_refuses_before_it_runs(photos, arguments, message):
    done = subprocess.run(
        [sys.executable, SCRIPT, photos, *arguments],
        cwd=photos.parent,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
