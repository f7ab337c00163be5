"""The ``retrieve`` command: what it prints and writes, what it does with mistakes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import photo_files
from helpers.locations import SCRIPTS
from PIL import Image

from sfm_front.cli.main import main

SCRIPT = SCRIPTS / "retrieve.py"
FAST = ("--global-descriptor", "vlad", "--max-features", "300", "--threads", "1")


@pytest.fixture(scope="module")
def world(tmp_path_factory) -> Path:
    """A folder of two scenes with a bad file, a query beside it, and an index."""
    world = tmp_path_factory.mktemp("world")
    names = [f"{scene}_{shift}.png" for scene in (1, 2) for shift in (0, 60, 120)]
    photo_files.save(world / "photos", *names)
    (world / "photos" / "bad.jpg").write_text("no image")
    photo_files.save(world / "outside", "2_30.png")
    return world


def retrieve(world: Path, *more: object, query: object = None) -> int:
    query = world / "outside" / "2_30.png" if query is None else query
    return main(
        [
            *("retrieve", str(world / "photos"), "--query", str(query)),
            *("--index", str(world / "index"), *FAST, *map(str, more)),
        ]
    )


def rows(text: str) -> list[list[str]]:
    """The table's rows: rank, name, cosine, inliers and perhaps ``wrong``."""
    return [line.split() for line in text.splitlines() if line.split()[0].isdigit()]


def test_the_table_has_the_best_photos_in_order(world, capsys):
    assert retrieve(world, "--top", "4") == 0
    out, err = capsys.readouterr()
    table = rows(out)
    assert [row[0] for row in table] == ["1", "2", "3", "4"]
    assert {row[1] for row in table[:3]} == {"2_0.png", "2_60.png", "2_120.png"}
    inliers = [int(row[3]) for row in table]
    assert inliers == sorted(inliers, reverse=True)
    assert out.startswith("2_30.png: 6 photos ranked in ")
    assert "skipped bad.jpg: not an image" in err
    assert "1 skipped" in err


def test_the_index_is_used_again(world, capsys):
    retrieve(world)
    capsys.readouterr()
    retrieve(world)
    assert "index: 6 photos unchanged, 0 described, 1 skipped" in capsys.readouterr().err


def test_json_takes_the_tables_place(world, capsys):
    assert retrieve(world, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found) == 6
    assert found[0]["name"] in ("2_0.png", "2_60.png")
    assert [row["rank"] for row in found] == [1, 2, 3, 4, 5, 6]
    inliers = [row["inliers"] for row in found]
    assert inliers == sorted(inliers, reverse=True)
    assert all(-1 <= row["cosine"] <= 1 for row in found)
    assert all(row["seconds"] >= row["coarse_seconds"] > 0 for row in found)


def test_json_goes_to_a_file_beside_the_table(world, tmp_path, capsys):
    assert retrieve(world, "--json", tmp_path / "a.json", "--method", "cosine") == 0
    assert rows(capsys.readouterr().out)
    found = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert {row["inliers"] for row in found} == {None}


def test_several_queries_one_after_the_other(world, capsys):
    photo = world / "photos" / "1_0.png"
    assert retrieve(world, "--query", photo, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert [row["query"] for row in found] == ["2_30.png"] * 6 + ["1_0.png"] * 5


def test_a_query_can_be_named_as_in_the_folder(world, capsys):
    assert retrieve(world, "--json", query="1_0.png") == 0
    found = json.loads(capsys.readouterr().out)
    assert "1_0.png" not in [row["name"] for row in found]
    assert found[0]["name"] == "1_60.png"


def test_what_the_truth_does_not_name_is_wrong(world, tmp_path, capsys):
    truth = tmp_path / "truth.txt"
    truth.write_text("1_0.png 1_60.png 30\n1_0.png 1_120.png 25\n")
    sheet = tmp_path / "sheet.png"
    assert retrieve(world, "--truth", truth, "--sheet", sheet, query="1_0.png") == 0
    table = rows(capsys.readouterr().out)
    assert [row[4:] for row in table] == [[], [], ["wrong"], ["wrong"], ["wrong"]]
    red = (np.asarray(Image.open(sheet)) == (214, 39, 40)).all(axis=2)
    assert red.any()
    # What is right is on the left of the first line.
    assert np.nonzero(red)[1].min() > red.shape[1] // 2 or not red[: len(red) // 2].any()


def test_pictures_are_written(world, tmp_path):
    sheet, matches = tmp_path / "s.png", tmp_path / "m.jpg"
    assert retrieve(world, "--sheet", sheet, "--draw-matches", matches) == 0
    for file in (sheet, matches):
        with Image.open(file) as picture:
            assert min(picture.size) > 300


def test_photos_that_are_added_are_found(tmp_path, capsys):
    photo_files.save(tmp_path / "photos", "1_0.png", "2_0.png")
    photo_files.save(tmp_path / "outside", "2_30.png")
    assert retrieve(tmp_path) == 0
    photo_files.save(tmp_path / "photos", "2_60.png")
    capsys.readouterr()
    assert retrieve(tmp_path, "--json") == 0
    out, err = capsys.readouterr()
    assert {row["name"] for row in json.loads(out)[:2]} == {"2_0.png", "2_60.png"}
    assert "2 photos unchanged, 1 described" in err


def test_nothing_is_written_to_the_photos_folder(tmp_path, monkeypatch):
    photo_files.save(tmp_path / "photos", "1_0.png", "1_60.png")
    before = sorted((tmp_path / "photos").iterdir())
    monkeypatch.chdir(tmp_path)
    assert main(["retrieve", "photos", "--query", "1_0.png", *FAST]) == 0
    assert sorted((tmp_path / "photos").iterdir()) == before
    assert (tmp_path / "outputs" / "photos" / "index" / "index.json").is_file()


def test_a_folder_of_the_query_alone_has_nothing_to_find(tmp_path, capsys):
    photo_files.save(tmp_path / "photos", "1_0.png")
    assert retrieve(tmp_path, "--draw-matches", tmp_path / "m.png", query="1_0.png") == 1
    assert "1_0.png: 0 photos ranked" in capsys.readouterr().out


def mistakes(world: Path, tmp_path: Path) -> dict[str, tuple[list[object], str]]:
    text = world / "photos" / "bad.jpg"
    return {
        "no such query": (["--query", tmp_path / "none.jpg"], "no such photo"),
        "bad query": (["--query", text], "not an image"),
        "candidates": (["--candidates", 0], "candidates must be at least 1"),
        "top": (["--top", 0], "--top must be at least 1"),
        "threads": (["--threads", 0], "threads must be at least 1"),
        "method": (["--method", "fast"], "method must be one of"),
        "descriptor": (["--global-descriptor", "gist"], "no global descriptor is called 'gist'"),
        "device": (["--device", "tpu"], "device must be one of auto, cpu, cuda"),
        "weights": (["--weights", text], "--weights goes with one network"),
        "picture": (["--sheet", tmp_path / "s.pdf"], "pictures are written as"),
        "truth": (["--truth", tmp_path / "none.txt"], "cannot be read"),
        "index": (["--index", text], "cannot be written"),
        "size": (["--max-image-size", 10], "max_image_size must be at least"),
    }


@pytest.mark.parametrize("mistake", mistakes(Path(), Path()))
def test_a_mistake_ends_in_one_line_and_status_2(world, tmp_path, capsys, mistake):
    options, message = mistakes(world, tmp_path)[mistake]
    retrieve(world)
    capsys.readouterr()
    assert retrieve(world, *options) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("sfm-front retrieve: ")
    assert message in last


def test_no_such_folder(tmp_path, capsys):
    assert retrieve(tmp_path) == 2
    assert "no such folder" in capsys.readouterr().err


def test_the_script_does_the_same(world):
    run = subprocess.run(
        [
            *(sys.executable, SCRIPT, world / "photos", "--query", "1_0.png"),
            *("--index", world / "index", *FAST, "--json"),
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(run.stdout)[0]["name"] == "1_60.png"
