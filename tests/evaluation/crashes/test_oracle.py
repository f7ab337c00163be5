"""The oracle notices each way in which an output can be less than whole."""

from __future__ import annotations

import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from helpers.photo_stream import described

from sfm_front.evaluation.crashes.oracle import acknowledged, database_violations, violations
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session

NUM_PHOTOS = 7


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """A finished output with one model."""
    orbit = make_scene(12, 400, seed=1, layout="orbit", outlier_ratio=0.05)
    output = tmp_path_factory.mktemp("whole") / "out"
    with Session(output, SessionOptions(global_descriptor="vlad", threads=1)) as session:
        for index in range(NUM_PHOTOS):
            session.add_extracted(described(orbit, index))
        session.finish()
    return output


@pytest.fixture
def output(whole, tmp_path) -> Path:
    return shutil.copytree(whole, tmp_path / "out")


def change(output: Path, *statements: str) -> None:
    with closing(sqlite3.connect(output / "database.db", isolation_level=None)) as database:
        for statement in statements:
            database.execute(statement)


def found_in_database(output: Path) -> list[str]:
    return database_violations(output / "database.db", acknowledged(output))


def test_a_whole_output_passes_and_is_not_touched(output):
    before = {path: path.stat().st_mtime_ns for path in output.rglob("*")}
    assert len(acknowledged(output)) == NUM_PHOTOS
    assert violations(output) == []
    assert {path: path.stat().st_mtime_ns for path in output.rglob("*")} == before


@pytest.mark.parametrize(
    ("statement", "noticed"),
    [
        ("DELETE FROM keypoints WHERE image_id = 3", "photo without keypoints: 000002.jpg"),
        ("DELETE FROM descriptors WHERE image_id = 3", "photo without descriptors: 000002.jpg"),
        ("DELETE FROM frame_data WHERE frame_id = 3", "photo without frame: 000002.jpg"),
        (
            "DELETE FROM sfm_front_photos WHERE image_id = 3",
            "photo without row in sfm_front_photos: 000002.jpg",
        ),
        ("DELETE FROM rigs", "photo without its camera or rig: 000000.jpg"),
        (
            "UPDATE descriptors SET rows = rows - 1 WHERE image_id = 3",
            "keypoints and descriptors differ in number: 000002.jpg",
        ),
        ("UPDATE sfm_front_photos SET digest = 'one'", "content twice: one"),
        (
            "INSERT INTO sfm_front_pairs (later, earlier) "
            "SELECT later, earlier FROM sfm_front_pairs LIMIT 1",
            "pair twice: ",
        ),
        (
            "INSERT INTO sfm_front_skipped VALUES ('000002.jpg', x'00', 1, 1, 'duplicate', '')",
            "photo both used and skipped: 000002.jpg",
        ),
        ("DELETE FROM two_view_geometries", "pair in matches that is not in two_view_geometries"),
        ("DELETE FROM sfm_front_pairs", "pair in matches that is not in (SELECT"),
        ("INSERT INTO matches VALUES (4294967299999, 0, 2, x'')", "pair whose photo is missing"),
        ("DROP TABLE sfm_front_pairs", "tables are missing: sfm_front_pairs"),
    ],
)
def test_a_half_or_doubled_photo_is_noticed(output, statement, noticed):
    change(output, statement)
    assert any(line.startswith(noticed) for line in found_in_database(output))


def test_a_missing_photo_that_was_acknowledged_is_noticed(output):
    tables = ("images", "keypoints", "descriptors", "frame_data", "sfm_front_photos")
    change(
        output,
        *(
            f"DELETE FROM {t} WHERE {'frame_id' if t == 'frame_data' else 'image_id'} = 7"
            for t in tables
        ),
    )
    assert "acknowledged photo is missing: 000006.jpg" in found_in_database(output)


def test_a_missing_pair_that_was_acknowledged_is_noticed(output):
    change(
        output,
        "DELETE FROM matches",
        "DELETE FROM two_view_geometries",
        "DELETE FROM sfm_front_pairs",
    )
    found = found_in_database(output)
    assert any(line.startswith("acknowledged pair is missing") for line in found)


def test_a_photo_acknowledged_twice_is_noticed(output):
    events = output / "events.jsonl"
    (line,) = (
        line
        for line in events.read_text().splitlines(keepends=True)
        if json.loads(line)["event"] == "photo_added" and json.loads(line)["image_id"] == 2
    )
    with events.open("a") as file:
        file.write(line)
    assert violations(output) == ["acknowledged twice: 000001.jpg"]


def test_a_damaged_database_is_noticed(output):
    with (output / "database.db").open("r+b") as file:
        file.truncate(100_000)
    assert found_in_database(output)
    (output / "database.db").unlink()
    assert f"no database, but {NUM_PHOTOS} photos acknowledged" in violations(output)


def test_half_models_are_noticed(output):
    points = output / "sparse" / "0" / "points3D.bin"
    points.write_bytes(points.read_bytes()[:-50])
    assert "half model: 0/points3D.bin is not as long as session.json says" in violations(output)
    shutil.rmtree(output / "sparse" / "0")
    assert violations(output) == ["0 models where session.json has 1"]
    shutil.rmtree(output / "sparse")
    assert violations(output) == []


def test_models_that_know_more_than_the_database_are_noticed(output):
    state = output / "sparse" / "session.json"
    content = json.loads(state.read_text())
    state.write_text(json.dumps({**content, "num_photos": NUM_PHOTOS + 1}))
    expected = f"models of {NUM_PHOTOS + 1} photos, the database holds {NUM_PHOTOS}"
    assert violations(output) == [expected]
