"""Searching real photos: four scenes in one folder, each photo a query."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from helpers.locations import DATA
from PIL import Image

from sfm_front.cli.main import main
from sfm_front.search.ground_truth import read_ground_truth

SCENES = ("crazyhorse", "lund_door", "sceaux_castle", "strecha_fountain_P11")
FAST = ("--max-image-size", "800", "--max-features", "1000", "--global-descriptor", "vlad")

BEST_OF_SCENE = 0.98
"""Share of queries whose most relevant photo is of their own scene."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DATA.is_dir(), reason="needs ../shared/data"),
]


@pytest.fixture
def folder(tmp_path) -> Path:
    folder = tmp_path / "photos"
    folder.mkdir()
    for scene in SCENES:
        (folder / scene).symlink_to(DATA / scene / "images")
    return folder


def retrieve(folder: Path, index: Path, *more: object) -> int:
    return main(["retrieve", str(folder), "--index", str(index), *FAST, *map(str, more)])


def test_the_most_relevant_photo_is_of_the_querys_scene(folder, tmp_path):
    queries = [
        f"{scene}/{path.name}"
        for scene in SCENES
        for path in sorted((DATA / scene / "images").iterdir())
    ]
    file = tmp_path / "answers.json"
    assert retrieve(folder, tmp_path / "index", "--json", file, "--query", *queries) == 0
    best = {row["query"]: row["name"] for row in json.loads(file.read_text()) if row["rank"] == 1}
    assert set(best) == set(queries)
    right = [name.split("/")[0] == query.split("/")[0] for query, name in best.items()]
    assert sum(right) >= BEST_OF_SCENE * len(queries)


def test_pictures_of_an_answer(tmp_path, capsys):
    scene = DATA / "sceaux_castle"
    name = sorted((scene / "images").iterdir())[3].name
    truth = read_ground_truth(scene / "pairs.txt", [p.name for p in (scene / "images").iterdir()])
    assert len(truth.of(name)) > 5
    sheet, matches = tmp_path / "sheet.png", tmp_path / "matches.png"
    more = ("--truth", scene / "pairs.txt", "--sheet", sheet, "--draw-matches", matches)
    assert retrieve(scene / "images", tmp_path, "--query", name, *more) == 0
    table = [line.split() for line in capsys.readouterr().out.splitlines()[2:]]
    assert table[0][1] in truth.of(name)
    for picture in (sheet, matches):
        with Image.open(picture) as image:
            assert min(image.size) > 400
