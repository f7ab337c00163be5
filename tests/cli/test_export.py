"""``sfm-front export`` on the rendered village, whose every pose is known."""

from __future__ import annotations

import csv
import json
import re
import shlex
import shutil

import cv2
import numpy as np
import pycolmap
import pytest
from helpers.foreign_readers import read_openmvs_scene, read_splat_scene
from helpers.locations import VILLAGE
from PIL import Image

from sfm_front.cli.main import main
from sfm_front.exporters.registry import TARGETS
from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.sidecar import FILE_NAME, Sidecar, write_sidecar
from sfm_front.georeference.spread import GeoreferenceState

PHOTOS = VILLAGE / "images"
NAMES = ("0001.jpg", "0005.jpg", "0012.jpg", "0018.jpg")
ORIGIN = LocalFrame(45.0, -30.0, 200.0)
GREY_LEVELS = 3.0  # what JPEG and two interpolations cost, in the mean
GPS_SIGMA_M = 1.0  # data_samples/README.md


@pytest.fixture(scope="module")
def village(tmp_path_factory):
    """An output with the true model of four photos, georeferenced, without a database."""
    output = tmp_path_factory.mktemp("village") / "out"
    model = pycolmap.Reconstruction(VILLAGE / "gt")
    for image_id in model.reg_image_ids():
        if model.image(image_id).name not in NAMES:
            model.deregister_frame(model.image(image_id).frame_id)
    (output / "sparse" / "0").mkdir(parents=True)
    model.write_binary(output / "sparse" / "0")
    metric = Sidecar(state=GeoreferenceState.METRIC, origin=ORIGIN, models_in_enu=(0,))
    write_sidecar(output / "sparse" / FILE_NAME, metric)
    return output


def run(capsys, *arguments):
    """Exit status, and what is said on standard output and standard error."""
    status = main(["export", *map(str, arguments)])
    out, err = capsys.readouterr()
    return status, out, err


def colors_at(photo, places):
    places = np.asarray(places, np.float32)[None] - 0.5
    return cv2.remap(photo, places[..., 0], places[..., 1], cv2.INTER_LINEAR)[0].astype(float)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "read"),
    [
        ("3dgs", lambda folder: read_splat_scene(folder, centred=True)),
        ("gsplat", lambda folder: read_splat_scene(folder, centred=False)),
        ("openmvs", read_openmvs_scene),
    ],
)
def test_a_point_has_its_colour_in_the_photo_before_and_after(
    village, tmp_path, capsys, target, read
):
    folder = tmp_path / "made"
    status, out, _ = run(
        capsys, village, "--to", target, "--images", PHOTOS, "--output", folder, "--threads", 2
    )
    assert status == 0
    assert f"{folder}: 4 photos, " in out
    model = pycolmap.Reconstruction(village / "sparse" / "0")
    for photo in read(folder):
        taken = np.asarray(Image.open(PHOTOS / photo.file.name))
        made = np.asarray(Image.open(photo.file))
        image = model.find_image_with_name(photo.file.name)
        seen = [p for p in image.points2D if p.has_point3D()]
        xyz = np.array([model.point3D(p.point3D_id).xyz for p in seen])
        before = colors_at(taken, [p.xy for p in seen])
        there = photo.project(xyz)
        inside = np.all((there > 5) & (there < np.array(photo.size) - 5), axis=1)
        assert inside.sum() > 100
        differences = [
            np.abs(colors_at(made, there + shift) - before)[inside].mean()
            for shift in ([0, 0], [1, 0], [-1, 0], [0, 1], [0, -1])
        ]
        assert differences[0] < GREY_LEVELS
        # And a single pixel beside it is seen.
        assert differences[0] < 0.6 * min(differences[1:])


def test_positions_are_those_of_the_drones_gps(village, tmp_path, capsys):
    status, _, _ = run(capsys, village, "--to", "geojson", "--output", tmp_path / "map")
    assert status == 0
    content = json.loads((tmp_path / "map" / "cameras.geojson").read_text())
    for feature in content["features"]:
        longitude, latitude, altitude = feature["geometry"]["coordinates"]
        with Image.open(PHOTOS / feature["properties"]["name"]) as photo:
            gps = photo.getexif().get_ifd(0x8825)
        measured = [
            sign * (d + m / 60 + s / 3600) for sign, (d, m, s) in ((1, gps[2]), (-1, gps[4]))
        ]
        metres = np.array([111_132.0, 111_320.0 * np.cos(np.radians(45))])
        apart = (np.array([latitude, longitude]) - np.array(measured, float)) * metres
        assert np.abs(apart).max() < 4 * GPS_SIGMA_M
        assert abs(altitude - float(gps[6])) < 4 * GPS_SIGMA_M


def test_photos_1_to_8_look_down(village, tmp_path, capsys):
    assert run(capsys, village, "--to", "csv", "--output", tmp_path / "table")[0] == 0
    with (tmp_path / "table" / "cameras.csv").open(newline="") as file:
        tilt = {
            r["name"]: np.hypot(float(r["pitch_deg"]), float(r["roll_deg"]))
            for r in csv.DictReader(file)
        }
    assert max(tilt["0001.jpg"], tilt["0005.jpg"]) < 15
    assert min(tilt["0012.jpg"], tilt["0018.jpg"]) > 30


def test_the_next_command_is_said_and_can_be_copied(village, tmp_path, capsys):
    folder = tmp_path / "it's here"
    status, out, _ = run(
        capsys, village, "--to", "nerfstudio", "--images", PHOTOS, "--output", folder, "--link"
    )
    assert status == 0
    told = re.search(r"^next: (.*)$", out, re.M)[1]
    assert shlex.split(told) == ["ns-train", "splatfacto", "--data", str(folder)]
    assert (folder / "images" / "0001.jpg").is_symlink()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--to", "3dgs"], "Give the folder that holds them with --images."),
        (["--to", "3dgs", "--images", "nowhere"], "nowhere: no such folder"),
        (["--to", "ply", "--model", "3"], "has no model 3; there are: 0"),
        (["--to", "3dgs", "--max-size", "0"], "max size must be at least 16 pixels, got 0"),
        (["--to", "3dgs", "--threads", "0"], "threads must be at least 1, got 0"),
        (["--to", "ply", "--output", "."], ".: is there already"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_mistake_is_one_line_and_leaves_nothing(village, capsys, monkeypatch, arguments, message):
    monkeypatch.chdir(village)
    before = sorted(village.rglob("*"))
    status, out, err = run(capsys, village, *arguments)
    assert (status, out) == (2, "")
    (line,) = err.splitlines()
    assert line.startswith("sfm-front export: ")
    assert message in line
    left = [p for p in village.rglob("*") if p not in before and p != village / "export"]
    assert left == []


@pytest.mark.parametrize("arguments", [[], ["--to", "obj"], ["--to", "ply", "--copy", "--link"]])
def test_what_is_no_export_is_status_2(village, capsys, arguments):
    with pytest.raises(SystemExit) as stop:
        main(["export", str(village), *arguments])
    assert stop.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("sfm-front export: ")
    assert line.endswith("; see sfm-front export --help")


def test_help_has_all_targets(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["export", "--help"])
    assert not stop.value.code
    told = capsys.readouterr().out
    assert all(f"  {name} " in told for name in TARGETS)


def test_photos_left_out_are_told(village, tmp_path, capsys):
    for name in NAMES[1:]:
        (tmp_path / "photos").mkdir(exist_ok=True)
        shutil.copy(PHOTOS / name, tmp_path / "photos" / name)
    arguments = ("--to", "bundler", "--images", tmp_path / "photos", "--output", tmp_path / "out")
    status, out, _ = run(capsys, village, *arguments)
    assert status == 0
    assert "3 photos, " in out
    note = "1 left out: '0001.jpg' (not found)"
    assert note in out
    assert note in (tmp_path / "out" / "README.txt").read_text()
