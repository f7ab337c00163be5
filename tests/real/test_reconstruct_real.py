"""Whole runs on real photos, smaller than by default to be quick."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pycolmap
import pytest
from helpers.locations import DATA

from sfm_front.cli.main import main
from sfm_front.evaluation.poses import auc, pose_errors

FAST = ("--max-image-size", "1000", "--max-features", "2000", "--global-descriptor", "vlad")

FOUNTAIN_AUC_AT_5_DEG = 0.85
DOOR_AUC_AT_5_DEG = 0.95

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DATA.is_dir(), reason="needs ../shared/data"),
]


@dataclass(frozen=True)
class Run:
    output: Path
    report: dict
    model: pycolmap.Reconstruction


def run(scene: str, output: Path, *more: str) -> Run:
    images = DATA / scene / "images"
    assert main(["reconstruct", str(images), "--output", str(output), *FAST, *more]) == 0
    report = json.loads((output / "report.json").read_text(encoding="utf-8"))
    return Run(output, report, pycolmap.Reconstruction(output / "sparse" / "0"))


@pytest.fixture(scope="module")
def fountain(tmp_path_factory) -> Run:
    return run("strecha_fountain_P11", tmp_path_factory.mktemp("fountain") / "out")


def test_the_fountain_is_whole_and_its_poses_are_those_surveyed(fountain):
    assert fountain.model.num_reg_images() == 11
    truth = pycolmap.Reconstruction(DATA / "strecha_fountain_P11" / "gt")
    assert auc(pose_errors(truth, [fountain.model]))[-1] > FOUNTAIN_AUC_AT_5_DEG


def test_pycolmap_on_its_own_builds_as_much_from_the_database(fountain, tmp_path):
    built = pycolmap.incremental_mapping(fountain.output / "database.db", tmp_path, tmp_path)
    assert max(model.num_reg_images() for model in built.values()) == 11


def test_the_door_is_whole_in_any_order(tmp_path):
    door = run("lund_door", tmp_path / "out", "--order", "random", "--seed", "1")
    assert door.model.num_reg_images() == 12
    truth = pycolmap.Reconstruction(DATA / "lund_door" / "gt")
    assert auc(pose_errors(truth, [door.model]))[-1] > DOOR_AUC_AT_5_DEG


def test_a_flight_is_whole_and_its_gps_is_in_the_database(tmp_path):
    flight = run("uav_brighton_beach", tmp_path / "out")
    assert flight.model.num_reg_images() == 18
    with pycolmap.Database.open(flight.output / "database.db") as database:
        assert database.num_pose_priors() == 18
