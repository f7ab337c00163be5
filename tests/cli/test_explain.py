"""Why a photo of a real output was placed, or was not."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pycolmap
import pytest
from helpers.locations import VILLAGE
from PIL import Image

from sfm_front.cli.main import main
from sfm_front.reports.explanation import pair_matches

NAMES = ("0001.jpg", "0002.jpg", "0003.jpg", "0010.jpg", "0011.jpg")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Five photos of the village, one of noise, one that is no image."""
    folder = tmp_path_factory.mktemp("photos")
    for name in NAMES:
        shutil.copy(VILLAGE / "images" / name, folder / name)
    noise = np.random.default_rng(0).integers(0, 255, (60, 80, 3), dtype=np.uint8)
    Image.fromarray(noise).resize((640, 480), Image.Resampling.BICUBIC).save(folder / "noise.png")
    (folder / "torn.jpg").write_bytes(b"no image")
    return folder


@pytest.fixture(scope="module")
def output(folder, tmp_path_factory):
    output = tmp_path_factory.mktemp("out") / "run"
    argv = ["reconstruct", str(folder), "--output", str(output), "--max-image-size", "800"]
    assert main([*argv, "--threads", "1"]) == 0
    return output


def test_a_placed_photo_tells_its_model_and_its_verified_candidates(output, capsys):
    assert main(["explain", str(output), "0002.jpg"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0].startswith("0002.jpg: placed in sparse/0, sees ")
    assert int(told[0].split()[-4]) > 50
    (candidate,) = (line for line in told if line.startswith("  0001.jpg"))
    assert "verified: " in candidate
    assert "verified with others, that came later or on a second look (inliers):" in told


def test_other_programs_get_all_of_it_as_json(output, tmp_path, capsys):
    drawn = ["--draw", str(tmp_path / "matches.png")]
    assert main(["explain", str(output), "0002.jpg", "--json", *drawn]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["name"], told["model"]) == ("0002.jpg", "sparse/0")
    assert {row["name"] for row in told["candidates"] if row["num_verified"]} == {"0001.jpg"}


def test_a_photo_that_was_not_placed_tells_why(output, capsys):
    assert main(["explain", str(output), "noise.png"]) == 1
    told = capsys.readouterr().out
    assert told.startswith("noise.png: not placed: no verified matches with any photo")
    assert "too few inliers among the largest features (" in told
    assert "verified: " not in told


def test_a_skipped_file_tells_its_reason(output, capsys):
    assert main(["explain", str(output), "torn.jpg"]) == 1
    assert capsys.readouterr().out.startswith("torn.jpg: skipped, not an image")


@pytest.mark.parametrize("photos_given", [False, True])
def test_matches_are_drawn(output, folder, tmp_path, capsys, photos_given):
    file = tmp_path / "matches.png"
    photos = ["--photos", str(folder)] if photos_given else []
    assert main(["explain", str(output), "0002.jpg", *photos, "--draw", str(file)]) == 0
    assert f"wrote {file}" in capsys.readouterr().err
    with Image.open(file) as picture:
        assert picture.width > 1000


def test_tentative_matches_of_a_verified_pair_are_those_of_the_database(output):
    matches = pair_matches(output, "0002.jpg", "0001.jpg")
    assert matches.verified
    assert 15 <= matches.is_inlier.sum() <= len(matches.is_inlier) == len(matches.xy1)
    with pycolmap.Database.open(output / "database.db") as database:
        ids = [database.read_image_with_name(name).image_id for name in ("0002.jpg", "0001.jpg")]
        assert len(database.read_matches(*ids)) == len(matches.xy1)
        inliers = database.read_two_view_geometry(*ids).inlier_matches
    assert len(inliers) == matches.is_inlier.sum()


def test_a_rejected_pair_is_matched_again(output, tmp_path):
    """The copy of the output has lost the pair, as if it had been rejected."""
    copy = tmp_path / "out"
    shutil.copytree(output, copy)
    kept = pair_matches(output, "0002.jpg", "0001.jpg")
    with pycolmap.Database.open(copy / "database.db") as database:
        ids = [database.read_image_with_name(name).image_id for name in ("0002.jpg", "0001.jpg")]
        database.delete_two_view_geometry(*ids)
        database.delete_matches(*ids)
    again = pair_matches(copy, "0002.jpg", "0001.jpg")
    assert not again.verified
    assert again.is_inlier.sum() == pytest.approx(kept.is_inlier.sum(), rel=0.2)
    assert len(again.xy1) > again.is_inlier.sum()


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["0022.jpg"], "has no photo called 0022.jpg; did you mean"),
        (["0002.jpg", "--draw", "x.png", "--photos", "."], "no such photo"),
    ],
)
def test_mistakes_are_one_line(output, capsys, more, told):
    assert main(["explain", str(output), *more]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line


def test_an_output_without_a_report_is_refused(tmp_path, capsys):
    assert main(["explain", str(tmp_path), "a.jpg"]) == 2
    assert "no readable report.json" in capsys.readouterr().err


def test_a_skipped_file_has_no_matches_to_draw(output, folder, tmp_path, capsys):
    file = tmp_path / "matches.png"
    argv = ["explain", str(output), "0002.jpg", "--photos", str(folder), "--draw", str(file)]
    assert main([*argv, "--against", "torn.jpg"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "torn.jpg is not in its database: nothing to draw" in line
    assert not file.exists()
