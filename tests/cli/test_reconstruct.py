"""The main job on the rendered village: bad files, odd names, interruption, repeatability."""

from __future__ import annotations

import io
import json
import re
import shutil
import sqlite3
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from helpers.locations import VILLAGE
from helpers.model_building import make_model
from helpers.reconstructing import reconstruct
from PIL import Image

from sfm_front.cli.reconstruct import default_output
from sfm_front.evaluation.poses import auc, pose_errors
from sfm_front.events import FinishingStep
from sfm_front.photos.source import list_photos, order_photos

SUB_FOLDER = "süd flug ✈"
pytestmark = pytest.mark.slow

AUC_AT_5_DEG = 0.85

BAD = {
    "empty.png": "empty file",
    "flat.png": "no features",
    "gone.jpg": "unreadable",
    "half.jpg": "truncated",
    "text.jpg": "not an image",
    "tiny.png": "too small",
    "x copy.jpg": "duplicate",
}


@dataclass(frozen=True)
class Run:
    status: int
    output: Path
    stdout: str
    report: dict
    names: list[str]


def tables(database: Path) -> dict[str, list[tuple[object, ...]]]:
    """The content of a database, table by table; not how long each took, and on how many
    threads."""
    with sqlite3.connect(database) as connection:
        names = [
            name
            for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type='table'")
            if name not in ("sfm_front_photos", "sfm_front_session")
        ]
        return {name: connection.execute(f'SELECT * FROM "{name}"').fetchall() for name in names}


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Run:
    """The whole village in a sub-folder of odd name, and one bad file of each kind beside it."""
    folder = tmp_path_factory.mktemp("photos")
    names = []
    for photo in sorted((VILLAGE / "images").iterdir()):
        names.append(f"{SUB_FOLDER}/Bild {photo.name}")
        target = folder / names[-1]
        target.parent.mkdir(exist_ok=True)
        shutil.copy(photo, target)
    first = folder / names[0]
    (folder / "empty.png").touch()
    Image.new("RGB", (300, 200), (90, 90, 120)).save(folder / "flat.png")
    (folder / "gone.jpg").symlink_to(folder / "moved away.jpg")
    (folder / "half.jpg").write_bytes(first.read_bytes()[:20_000])
    (folder / "text.jpg").write_text("this is no image")
    Image.new("RGB", (20, 16)).save(folder / "tiny.png")
    shutil.copy(first, folder / "x copy.jpg")
    output = tmp_path_factory.mktemp("output") / "out"
    stdout = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", stdout)
        status = reconstruct(folder, output)
    report = json.loads((output / "report.json").read_text(encoding="utf-8"))
    return Run(status, output, stdout.getvalue(), report, names)


def test_bad_files_do_not_stop_it(run):
    assert run.status == 0
    assert run.report["totals"]["photos"] == len(run.names) + len(BAD)
    assert run.report["totals"]["skipped"] == len(BAD)


@pytest.mark.parametrize("name", BAD)
def test_each_bad_file_is_named_with_its_reason(run, name):
    (row,) = [row for row in run.report["photos"] if row["name"] == name]
    assert row["skipped"]["reason"] == BAD[name]
    assert not row["registered"]
    lines = run.stdout.splitlines()
    # Once when it comes, once in the summary.
    assert [line for line in lines if line.startswith(f"skipped {name}: {BAD[name]}")]
    assert [line for line in lines if line.startswith(f"  {name}: {BAD[name]}")]


def test_a_page_is_written_last(run):
    page = run.output / "report.html"
    assert f"to look at: {page}" in run.stdout.splitlines()[-4:]
    text = page.read_text(encoding="utf-8")
    assert f"All {len(run.names)} photos are in one model" in text
    assert all(name in text for name in (*run.names, *BAD))


def test_every_good_photo_is_registered(run):
    (model,) = run.report["models"]
    assert model["registered"] == len(run.names)
    assert {row["name"] for row in run.report["photos"] if row["registered"]} == set(run.names)


def test_the_poses_are_true(run):
    gt = pycolmap.Reconstruction(VILLAGE / "gt")
    renamed = {
        f"{SUB_FOLDER}/Bild {image.name}": image.cam_from_world() for image in gt.images.values()
    }
    errors = pose_errors(
        make_model(renamed), [pycolmap.Reconstruction(run.output / "sparse" / "0")]
    )
    assert auc(errors)[-1] > AUC_AT_5_DEG


def test_photos_are_in_the_database_under_their_names(run):
    with pycolmap.Database.open(run.output / "database.db") as database:
        assert {image.name for image in database.read_all_images()} == set(run.names)
        assert database.num_cameras() == 1
        assert database.num_pose_priors() == len(run.names)


def test_keypoints_are_in_pixels_of_the_file(run):
    """The photos were reduced from 1000 to 640 pixels."""
    with pycolmap.Database.open(run.output / "database.db") as database:
        (camera,) = database.read_all_cameras()
        keypoints = np.concatenate([database.read_keypoints(i + 1) for i in range(3)])
    assert (camera.width, camera.height) == (1000, 750)
    assert keypoints[:, :2].max(axis=0) == pytest.approx((1000, 750), rel=0.1)
    assert camera.mean_focal_length() == pytest.approx(812.4, rel=0.01)


def test_the_summary_closes_the_output(run):
    count = len(run.names)
    photos = run.report["totals"]["photos"]
    verdict = f"All {count} photos are in one model, in metres; {len(BAD)} files were skipped"
    assert re.search(rf"^{verdict}", run.stdout, re.M)
    assert re.search(rf"^photo {photos} of {photos}: \d+ placed, \d+ points", run.stdout, re.M)
    assert "by stage" not in run.stdout


def test_the_steps_of_the_end_are_told_as_they_begin(run):
    steps = [step.value for step in FinishingStep if step is not FinishingStep.CONTROL_POINTS]
    steps[3] += f" ({run.report['models'][0]['registered']} photos)"
    told = re.findall(r"^finishing.*$", run.stdout, re.M)
    assert told == [
        *(f"finishing {number} of 6: {step}" for number, step in enumerate(steps, start=1)),
        "finishing: drawing the page",
    ]


def test_json_is_all_that_standard_output_has(five, tmp_path, capsys):
    (five / "torn.jpg").write_bytes(b"no image")
    output = tmp_path / "out"
    assert reconstruct(five, output, "--json") == 0
    told, beside = capsys.readouterr()
    result = json.loads(told)
    assert result["verdict"]["level"] == "good"
    assert result["verdict"]["sentence"] in beside.splitlines()
    assert [row["name"] for row in result["skipped"]] == ["torn.jpg"]
    (model,) = result["models"]
    assert len(pycolmap.Reconstruction(model["path"]).reg_image_ids()) == model["registered"] == 5
    assert Path(result["report_html"]).is_file()
    assert Path(result["report_json"]).is_file()
    # The same of a run that has nothing to do.
    assert reconstruct(five, output, "--json", "--quiet") == 0
    again, nothing = capsys.readouterr()
    assert (json.loads(again), nothing) == (result, "")


def test_quiet_is_one_line(five, tmp_path, capsys):
    (five / "torn.jpg").write_bytes(b"no image")
    assert reconstruct(five, tmp_path / "out", "--quiet") == 0
    told, beside = capsys.readouterr()
    (line,) = told.splitlines()
    assert line.startswith("All 5 photos are in one model")
    assert beside == ""


def test_one_thread_and_a_seed_repeat_to_the_bit(five, tmp_path):
    for name in ("a", "b"):
        assert reconstruct(five, tmp_path / name, "--threads", "1", "--seed", "3") == 0
    models = [
        {path.name: path.read_bytes() for path in (tmp_path / name / "sparse" / "0").iterdir()}
        for name in ("a", "b")
    ]
    assert models[0] == models[1]
    assert "points3D.bin" in models[0]
    first, second = (tables(tmp_path / name / "database.db") for name in ("a", "b"))
    assert first == second
    # What runs ahead and side by side changes nothing of what is found and matched.
    assert reconstruct(five, tmp_path / "c", "--threads", "3", "--seed", "3") == 0
    assert tables(tmp_path / "c" / "database.db") == first


def test_overwrite_replaces_what_a_session_wrote_and_nothing_else(five, tmp_path):
    output = tmp_path / "out"
    output.mkdir()
    (output / "notes.txt").write_text("mine")
    (output / "database.db").write_bytes(b"of an earlier session")
    (output / "retrieval.jsonl").touch()
    (output / "sparse" / "7").mkdir(parents=True)
    for photo in sorted(five.iterdir())[2:]:
        photo.unlink()
    assert reconstruct(five, output, "--overwrite") in (0, 1)
    assert (output / "notes.txt").read_text() == "mine"
    assert not (output / "sparse" / "7").exists()
    with pycolmap.Database.open(output / "database.db") as database:
        assert database.num_images() == 2


def test_a_folder_with_other_files_is_told_of_before_it_is_written_to(five, tmp_path, capsys):
    output = tmp_path / "project"
    (output / "notes").mkdir(parents=True)
    for _ in range(2):
        reconstruct(five, output, "--max-features", "50")
    told = capsys.readouterr().out
    assert told.count("project: is not empty; notes will stay as they are") == 1


def test_random_order_is_the_seeds(five, tmp_path):
    output = tmp_path / "out"
    reconstruct(five, output, "--order", "random", "--seed", "2", "--max-features", "50")
    rows = json.loads((output / "report.json").read_text())["photos"]
    expected = [photo.name for photo in order_photos(list_photos(five), "random", seed=2)]
    assert [row["name"] for row in rows] == expected != sorted(expected)


def test_text_is_written_beside_the_binary_form(five, tmp_path):
    assert reconstruct(five, tmp_path / "out", "--text") == 0
    model = tmp_path / "out" / "sparse" / "0"
    assert {"images.bin", "images.txt", "points3D.ply"} <= {path.name for path in model.iterdir()}


@pytest.mark.parametrize(
    ("folder", "output"),
    [
        ("flight", "outputs/flight"),
        ("flight/", "outputs/flight"),
        ("a/village/images", "outputs/village"),
        ("a/village/Images", "outputs/village"),
    ],
)
def test_the_output_is_named_after_the_folder(folder, output):
    assert default_output(Path(folder)) == Path(output)


def test_the_same_command_again_has_nothing_to_do(five, tmp_path, capsys):
    output = tmp_path / "out"
    assert reconstruct(five, output) == 0
    before = {path: path.read_bytes() for path in (output / "sparse").rglob("*.bin")}
    assert len(before) >= 3
    capsys.readouterr()
    assert reconstruct(five, output) == 0
    assert "finished, and holds all photos" in capsys.readouterr().out
    assert {path: path.read_bytes() for path in (output / "sparse").rglob("*.bin")} == before


def test_another_folder_is_added_when_asked(five, tmp_path, capsys):
    """The second folder's names are taken, and one of its photos is in the first one, too."""
    output, second = tmp_path / "out", tmp_path / "second"
    second.mkdir()
    for name, other in (("0001.jpg", "0004.jpg"), ("0002.jpg", "0005.jpg"), ("0003.jpg", None)):
        shutil.copy(five / (other or name), second / name)
    for name in ("0004.jpg", "0005.jpg"):
        (five / name).unlink()
    assert reconstruct(five, output) == 0
    assert reconstruct(second, output) == 2
    assert "Give --append to add those of" in capsys.readouterr().err
    assert reconstruct(second, output, "--append") == 0
    report = json.loads((output / "report.json").read_text())
    registered = [row["name"] for row in report["photos"] if row["registered"]]
    assert registered == ["0001.jpg", "0002.jpg", "0003.jpg", "second/0001.jpg", "second/0002.jpg"]
    (copy,) = [row for row in report["photos"] if row["skipped"]]
    assert copy["name"] == "second/0003.jpg"
    assert report["totals"]["models"] == 1


def test_events_are_printed_instead_of_the_progress(five, tmp_path, capsys):
    assert reconstruct(five, tmp_path / "out", "--events", "-") == 0
    printed = capsys.readouterr()
    events = [json.loads(line) for line in printed.out.splitlines()]
    assert [event["event"] for event in events][:2] == ["session_started", "photo_arrived"]
    assert events[-1]["event"] == "session_ended"
    assert [e["name"] for e in events if e["event"] == "photo_added"] == [
        f"{n:04d}.jpg" for n in range(1, 6)
    ]
    assert "All 5 photos are in one model" in printed.err
    written = (tmp_path / "out" / "events.jsonl").read_text().splitlines()
    assert [json.loads(line)["event"] for line in written] == [e["event"] for e in events]
