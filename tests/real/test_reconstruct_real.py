"""Whole runs on real photos, smaller than by default to be quick."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from helpers.locations import DATA

from sfm_front.cli.main import main
from sfm_front.evaluation.poses import auc, pose_errors

FAST = ("--max-image-size", "1000", "--max-features", "2000", "--global-descriptor", "vlad")

FOUNTAIN_AUC_AT_5_DEG = 0.85
DOOR_AUC_AT_5_DEG = 0.95
# Half a point in a hundred.
MAX_AUC_LOST = 0.005

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


@pytest.mark.parametrize("scene", ["strecha_fountain_P11", "lund_door"])
def test_two_folders_one_after_the_other_give_what_one_gives(scene, tmp_path):
    photos = sorted((DATA / scene / "images").iterdir())
    halves = {"first": photos[: len(photos) // 2], "second": photos[len(photos) // 2 :]}
    for name, half in halves.items():
        (tmp_path / name).mkdir()
        for photo in half:
            shutil.copy(photo, tmp_path / name / photo.name)
        command = ["reconstruct", str(tmp_path / name), "--output", str(tmp_path / "two"), *FAST]
        assert main([*command, "--append"]) == 0
    at_once = run(scene, tmp_path / "once")
    (folder,) = (path for path in (tmp_path / "two" / "sparse").iterdir() if path.is_dir())
    two = pycolmap.Reconstruction(folder)
    assert two.num_reg_images() == len(photos)
    assert two.num_cameras() == at_once.model.num_cameras()
    for image in two.images.values():
        image.name = image.name.removeprefix("second/")
    truth = pycolmap.Reconstruction(DATA / scene / "gt")
    areas, expected = (auc(pose_errors(truth, [model])) for model in (two, at_once.model))
    assert np.all(np.array(expected) - areas <= MAX_AUC_LOST)
