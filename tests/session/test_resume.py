"""A session that ended in any way is gone on with, and nothing is done twice."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pycolmap
import pytest
from helpers.locations import ROOT, TESTS
from helpers.photo_stream import described, position_errors_m

from sfm_front.errors import InputError, StorageError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import Event, ModelStarted, PhotoAdded, SessionEnded, SessionStarted
from sfm_front.session import snapshots
from sfm_front.session.options import SessionOptions
from sfm_front.session.resume import Newcomers, is_finished
from sfm_front.session.session import Session
from sfm_front.session.summing_up import SessionResult
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import ExtractedPhoto, NotYet, PhotoPath, Skipped, SkipReason

NUM_PHOTOS = 12
POSITION_TOLERANCE_M = 0.3
# Every photo is followed by a snapshot, or none is.
ALWAYS, NEVER = 1e-9, 1e9


def options(**changes: object) -> SessionOptions:
    return SessionOptions(**({"global_descriptor": "vlad", "threads": 1} | changes))


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 400, seed=1, layout="orbit", outlier_ratio=0.05)


@pytest.fixture(scope="module")
def photos(orbit) -> list[ExtractedPhoto]:
    return [described(orbit, index) for index in range(NUM_PHOTOS)]


def assert_whole(result: SessionResult, orbit: SyntheticScene, output: Path) -> None:
    assert [model.num_registered for model in result.models] == [NUM_PHOTOS]
    errors = position_errors_m(result.models[0].reconstruction, orbit)
    assert errors.max() < POSITION_TOLERANCE_M
    report = json.loads((output / "report.json").read_text())
    names = [orbit.name(index) for index in range(NUM_PHOTOS)]
    assert [row["name"] for row in report["photos"]] == names
    lines = (output / "retrieval.jsonl").read_text().splitlines()
    assert [json.loads(line)["name"] for line in lines] == names
    with pycolmap.Database.open(output / "database.db") as database:
        assert [image.name for image in database.read_all_images()] == names


@pytest.mark.parametrize("seconds", [ALWAYS, NEVER])
@pytest.mark.parametrize("stop_after", [1, 7])
def test_a_photo_whose_process_was_killed_before_it_told_of_it_is_acknowledged(
    orbit, photos, tmp_path, monkeypatch, stop_after, seconds
):
    monkeypatch.setattr(snapshots, "_MAX_SHARE", math.inf)
    output, log = tmp_path / "out", tmp_path / "out" / "events.jsonl"
    with Session(output, options(snapshot_seconds=seconds)) as session:
        for photo in photos[:stop_after]:
            session.add_extracted(photo)
    whole = [line for line in log.read_text().splitlines() if '"photo_added"' in line]
    last = whole[-1]
    log.write_text(log.read_text().partition(last)[0])
    for _ in range(2):
        with Session(output, options(), resume=True):
            pass
        events = [json.loads(line) for line in log.read_text().splitlines()]
        added = [event for event in events if event["event"] == "photo_added"]
        assert [event["name"] for event in added] == [orbit.name(i) for i in range(stop_after)]
        told = json.loads(last)
        kept = ("image_id", "num_keypoints", "num_registered", "verified")
        assert {key: added[-1][key] for key in kept} == {key: told[key] for key in kept}


@pytest.mark.parametrize("seconds", [ALWAYS, NEVER])
@pytest.mark.parametrize("stop_after", [1, 7])
def test_a_session_that_was_not_finished_is(
    orbit, photos, tmp_path, monkeypatch, stop_after, seconds
):
    monkeypatch.setattr(snapshots, "_MAX_SHARE", math.inf)
    output = tmp_path / "out"
    with Session(output, options(snapshot_seconds=seconds)) as session:
        for photo in photos[:stop_after]:
            session.add_extracted(photo)
    heard: list[Event] = []
    with Session(output, options(), resume=True, on_event=heard.append) as session:
        assert session.num_restored == stop_after
        assert isinstance(heard[0], SessionStarted)
        assert heard[0].num_photos == stop_after
        # From the snapshot models go on; without one, they are started again.
        started = [event for event in heard if isinstance(event, ModelStarted)]
        assert bool(started) == (seconds == NEVER and stop_after >= 5)
        for photo in photos[stop_after:]:
            assert isinstance(session.add_extracted(photo), PhotoAdded)
        # What is known already is not taken twice.
        assert isinstance(session.add_extracted(replace(photos[0], name="copy.jpg")), Skipped)
        result = session.finish()
    assert_whole(replace_skipped(result), orbit, without_copy(output))


def replace_skipped(result: SessionResult) -> SessionResult:
    assert [photo.name for photo in result.summary.skipped] == ["copy.jpg"]
    return result


def without_copy(output: Path) -> Path:
    file = output / "report.json"
    content = json.loads(file.read_text())
    content["photos"] = [row for row in content["photos"] if row["name"] != "copy.jpg"]
    file.write_text(json.dumps(content))
    return output


def test_a_finished_session_is_extended(orbit, photos, tmp_path):
    output = tmp_path / "out"
    with Session(output, options()) as session:
        for photo in photos[:7]:
            session.add_extracted(photo)
        first = session.finish()
    assert first.models[0].num_registered == 7
    with PhotoDatabase(output / "database.db") as database:
        assert is_finished(database)
    with Session(output, options(), resume=True) as session:
        for photo in photos[7:]:
            session.add_extracted(photo)
        result = session.finish()
    assert_whole(result, orbit, output)


KILLED = """
import math, os, sys
from pathlib import Path
from helpers.photo_stream import described
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.session import snapshots
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session

snapshots._MAX_SHARE = math.inf
orbit = make_scene(12, 400, seed=1, layout="orbit", outlier_ratio=0.05)
options = SessionOptions(global_descriptor="vlad", threads=1, snapshot_seconds=1e-9)
session = Session(Path(sys.argv[1]), options)
for index in range(7):
    session.add_extracted(described(orbit, index))
os._exit(9)
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory) -> Path:
    """The output of a process that died after seven photos."""
    output = tmp_path_factory.mktemp("killed") / "out"
    path = os.pathsep.join([str(TESTS), str(ROOT)])
    run = subprocess.run(
        [sys.executable, "-c", KILLED, str(output)],
        env=os.environ | {"PYTHONPATH": path},
        check=False,
    )
    assert run.returncode == 9
    return output


def damage(output: Path, what: str) -> None:
    if what == "models cut short":
        points = output / "sparse" / "0" / "points3D.bin"
        points.write_bytes(points.read_bytes()[:1000])
    elif what == "no models":
        shutil.rmtree(output / "sparse")
    elif what == "killed between the moves":
        (output / "sparse").rename(output / "sparse.old")
    elif what == "a torn line of events":
        with (output / "events.jsonl").open("a") as events:
            events.write('{"v": 1, "eve')
    elif what == "no lines of retrieval":
        (output / "retrieval.jsonl").write_text("")


@pytest.mark.parametrize(
    "what",
    [
        "nothing",
        "models cut short",
        "no models",
        "killed between the moves",
        "a torn line of events",
        "no lines of retrieval",
    ],
)
def test_what_a_kill_or_damage_left_is_gone_on_with(orbit, photos, killed, tmp_path, what):
    output = tmp_path / "out"
    shutil.copytree(killed, output)
    damage(output, what)
    with Session(output, options(), resume=True) as session:
        assert session.num_restored == 7
        for photo in photos[7:]:
            session.add_extracted(photo)
        result = session.finish()
    assert_whole(result, orbit, output)
    events = [json.loads(line) for line in (output / "events.jsonl").read_text().splitlines()]
    added = [event["name"] for event in events if event["event"] == "photo_added"]
    assert added == [orbit.name(index) for index in range(NUM_PHOTOS)]


@pytest.mark.skipif(os.name == "nt", reason="Windows does not remove open files")
def test_an_output_that_was_removed_is_not_made_anew_in_part(photos, tmp_path):
    output = tmp_path / "out"
    with Session(output, options()) as session:
        for photo in photos[:7]:
            session.add_extracted(photo)
        shutil.rmtree(output)
        with pytest.raises(StorageError, match="was removed"):
            session.finish()
    assert not output.exists()


def test_other_options_are_refused_by_name(photos, tmp_path):
    output = tmp_path / "out"
    with Session(output, options()) as session:
        session.add_extracted(photos[0])
    with pytest.raises(InputError, match="was made with max_features = 4000, now it is 3000"):
        Session(output, options(max_features=3000), resume=True)
    # How the work is done may change, and a refused try leaves the session as it was.
    with Session(output, options(threads=2, text=True), resume=True) as session:
        assert session.num_restored == 1


def test_the_output_of_an_earlier_version_is_refused(tmp_path):
    output = tmp_path / "out"
    output.mkdir()
    (output / "retrieval.jsonl").touch()
    with pycolmap.Database.open(output / "database.db") as database:
        camera = pycolmap.Camera.create_from_model_name(1, "SIMPLE_RADIAL", 500.0, 640, 480)
        database.write_camera(camera, use_camera_id=True)
        database.write_image(pycolmap.Image(name="a.jpg", camera_id=1))
    with pytest.raises(InputError, match="of an earlier version"):
        Session(output, options(), resume=True)


@pytest.fixture
def folder(tmp_path) -> list[PhotoPath]:
    """Three files, of which a session has used the first and skipped the second."""
    photos = []
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        path = tmp_path / "flight" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(name.encode())
        photos.append(PhotoPath(name, path))
    return photos


@pytest.fixture
def database(orbit, folder, tmp_path):
    with PhotoDatabase(tmp_path / "database.db") as database:
        used = replace(described(orbit, 0), name="a.jpg", path=folder[0].path)
        database.write(1, used, orbit.camera, [])
        database.write_skipped(Skipped("b.jpg", SkipReason.TRUNCATED), folder[1].path)
        yield database


def new_among(database: PhotoDatabase, photos: list[PhotoPath]) -> tuple[list[str], list[str]]:
    """Names of those that are new, asked for one by one, too; and what is told."""
    told: list[str] = []
    newcomers = Newcomers(database, photos[0].path.parent, Path("out"), append=False)
    new = [photo.name for photo in newcomers.among(photos, told.append)]
    one_by_one = newcomers.among(iter([NotYet(0.0), *photos]), lambda _: None)
    assert next(one_by_one) == NotYet(0.0)
    assert [photo.name for photo in one_by_one] == new
    return new, told


def test_what_is_known_is_not_new(database, folder):
    database.remember("sources", json.dumps({str(folder[0].path.parent.resolve()): ""}))
    assert new_among(database, folder) == (["c.jpg"], [])


def test_a_used_photo_that_changed_is_told_and_a_skipped_one_is_tried_again(database, folder):
    database.remember("sources", json.dumps({str(folder[0].path.parent.resolve()): ""}))
    for photo in folder[:2]:
        photo.path.write_bytes(b"another photo")
    new, (told,) = new_among(database, folder)
    assert new == ["b.jpg", "c.jpg"]
    assert told == "a.jpg: has changed since it was taken in; the old one stays"


def test_another_folder_is_refused_before_it_holds_a_photo(database, folder, tmp_path):
    database.remember("sources", json.dumps({str(folder[0].path.parent.resolve()): ""}))
    with pytest.raises(InputError, match="Give --append to add those of"):
        Newcomers(database, tmp_path / "still empty", tmp_path, append=False)


def test_a_file_that_was_skipped_is_so_no_longer_once_it_is_used(orbit, database, folder):
    used = replace(described(orbit, 1), name="b.jpg", path=folder[1].path)
    database.write(2, used, orbit.camera, [])
    assert database.skipped() == []


def test_another_folder_is_added_only_when_wanted(database, folder, tmp_path):
    def named(where: Path, photos: list[PhotoPath], append: bool = False) -> list[str]:
        newcomers = Newcomers(database, where, tmp_path, append=append)
        named = list(newcomers.among(photos, lambda _: None))
        assert [photo.path for photo in named] == [photo.path for photo in photos]
        return [photo.name for photo in named]

    first, second, third = (tmp_path / name for name in ("flight", "two/flight", "three"))
    assert named(first, folder) == ["flight/a.jpg", "flight/b.jpg", "flight/c.jpg"]
    with pytest.raises(InputError, match="Give --append to add those of"):
        named(second, folder)
    assert named(second, folder, append=True)[0] == "flight1/a.jpg"
    other = [PhotoPath("z.jpg", tmp_path / "z.jpg")]
    # Names that may still come in either must differ.
    assert named(third, other, append=True) == ["three/z.jpg"]
    assert named(third, folder, append=True)[0] == "three/a.jpg"
    # Each folder keeps the names it was given.
    assert named(second, folder)[0] == "flight1/a.jpg"
    assert named(first, folder)[0] == "flight/a.jpg"


def test_a_session_that_is_left_says_so(photos, tmp_path):
    heard: list[Event] = []
    with Session(tmp_path / "out", options(), on_event=heard.append) as session:
        session.add_extracted(photos[0])
    assert heard[-1] == SessionEnded(False, 1, 0, 0)
