"""The lens benchmark: its table, and the script as it is run."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import dataclass
from types import SimpleNamespace

import pytest
from helpers.locations import SAMPLES, SCRIPTS, VILLAGE

from sfm_front.evaluation.lenses.trials import LensTrial, format_trials


def run(*arguments, cwd):
    return subprocess.run(
        [sys.executable, SCRIPTS / "benchmark_lenses.py", *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
    )


@dataclass
class Tried:
    scene: str
    quality: SimpleNamespace


def tried(lens: str, model: str, *areas: float) -> LensTrial:
    return LensTrial(lens, model, Tried("yard", SimpleNamespace(auc=areas)))


def test_the_table_says_how_far_auto_is_from_no_distortion():
    table = format_trials(
        [
            tried("undistorted", "auto", 0.9, 0.95, 0.99),
            tried("undistorted", "OPENCV", 0.8, 0.85, 0.9),
            tried("opencv", "auto", 0.875, 0.9, 0.95),
            tried("opencv", "OPENCV", 0.5, 0.6, 0.7),
        ]
    )
    assert table.splitlines()[2:] == [
        "| yard | undistorted | 90.0 / 95.0 / 99.0 | 80.0 / 85.0 / 90.0 | +0.0 |",
        "| yard | opencv | 87.5 / 90.0 / 95.0 | 50.0 / 60.0 / 70.0 | -2.5 |",
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--lenses", "opencv,pinhole"], "no lens pinhole"),
        (["--models", "auto,OPENCVX"], "camera model must be auto or one of"),
        (["--scenes", "vilage"], "did you mean village?"),
    ],
)
def test_mistakes_end_in_one_line(tmp_path, arguments, message):
    done = run(*arguments, "--data", SAMPLES, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_scene_is_tried_through_a_lens(tmp_path):
    images = tmp_path / "data" / "few" / "images"
    images.mkdir(parents=True)
    for photo in sorted((VILLAGE / "images").iterdir())[:4]:
        shutil.copy(photo, images)
    shutil.copytree(VILLAGE / "gt", images.parent / "gt")
    arguments = ("--data", "data", "--cache", "cache", "--renders", "renders", "--models", "auto")
    done = run(*arguments, "--lenses", "opencv", "--json", "all.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[2].startswith("| few | opencv | ")
    (one,) = json.loads((tmp_path / "all.json").read_text(encoding="utf-8"))["trials"]
    assert (one["lens"], one["model"], one["trial"]["quality"]["registered"]) == (
        "opencv",
        "auto",
        4,
    )
    assert len(list((tmp_path / "renders" / "opencv" / "few" / "images").iterdir())) == 4
