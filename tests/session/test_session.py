"""A whole session on photos that are described already."""

from __future__ import annotations

import json
import random
import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from helpers.library_threads import library_threads, needs_blas, several_threads
from helpers.locations import VILLAGE
from helpers.photo_files import save
from helpers.photo_stream import described, position_errors_m, registered_names, true_matches

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import (
    Event,
    ModelRefined,
    ModelStarted,
    PhotoAdded,
    PhotoPlaced,
    PhotoWaiting,
    SessionEnded,
    SessionStarted,
)
from sfm_front.mapping.atlas import AtlasOptions
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.mapping.refinement_schedule import ScheduleOptions
from sfm_front.photos.cameras import CameraOptions
from sfm_front.reports.run_summary import Latency
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session
from sfm_front.types import ModelSummary, PhotoPath, Skipped, SkipReason

NUM_PHOTOS = 16
# The photos stand on a circle of 40 m; 0.5 px of noise are 15 mm on the surface they see.
POSITION_TOLERANCE_M = 0.3
ESSENTIAL_TOLERANCE = 1e-3
OUTLIERS = 0.05


def options(threads: int = 1, **changes: object) -> SessionOptions:
    defaults = {
        "global_descriptor": "vlad",
        "threads": threads,
        "atlas": AtlasOptions(mapper=MapperOptions(num_threads=threads)),
    }
    return SessionOptions(**(defaults | changes))


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 400, seed=1, layout="orbit", outlier_ratio=OUTLIERS)


@pytest.fixture(scope="module")
def session(orbit, tmp_path_factory) -> tuple[Path, list[PhotoAdded], list[ModelSummary]]:
    """Output folder, steps and models of the orbit in its order, the camera unknown."""
    output = tmp_path_factory.mktemp("session")
    with Session(output, options()) as session:
        steps = [session.add_extracted(described(orbit, index)) for index in range(NUM_PHOTOS)]
        models = list(session.finish().models)
    return output, steps, models


def tables(database: Path) -> dict[str, list[tuple[object, ...]]]:
    """The content of a database, table by table."""
    with sqlite3.connect(database) as connection:
        names = [
            name
            for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type='table'")
            if name != "sfm_front_session"  # whether it is finished
        ]
        return {name: connection.execute(f'SELECT * FROM "{name}"').fetchall() for name in names}


def test_every_photo_is_registered_at_its_true_place(orbit, session):
    _, _, models = session
    assert [model.num_registered for model in models] == [NUM_PHOTOS]
    errors = position_errors_m(models[0].reconstruction, orbit)
    assert errors.max() < POSITION_TOLERANCE_M


def test_the_focal_length_is_found(orbit, session):
    _, _, models = session
    (camera,) = models[0].reconstruction.cameras.values()
    assert camera.mean_focal_length() == pytest.approx(orbit.camera.mean_focal_length(), rel=0.02)


def test_pycolmap_on_its_own_builds_as_much_from_the_database(session, tmp_path):
    """The database is not changed, and no option is but those that make the run repeatable."""
    output, _, models = session
    pipeline = pycolmap.IncrementalPipelineOptions(num_threads=1)
    built = pycolmap.incremental_mapping(
        output / "database.db", tmp_path, tmp_path / "sparse", pipeline
    )
    assert max(model.num_reg_images() for model in built.values()) == models[0].num_registered


def test_the_models_are_on_disk(session):
    output, _, models = session
    read = pycolmap.Reconstruction(output / "sparse" / "0")
    assert models[0].path == output / "sparse" / "0"
    assert registered_names([read]) == registered_names([models[0].reconstruction])
    assert read.num_points3D() == models[0].num_points
    assert models[0].mean_reprojection_error_px < 1.0
    assert models[0].mean_track_length > 2.0


def test_a_step_says_what_was_retrieved_and_placed(orbit, session):
    _, steps, _ = session
    assert [step.image_id for step in steps] == list(range(1, NUM_PHOTOS + 1))
    first, last = steps[0], steps[-1]
    assert first.candidates == ()
    assert first.most_relevant is None
    assert last.num_keypoints == len(orbit.photo(NUM_PHOTOS - 1).features)
    assert len(last.candidates) == NUM_PHOTOS - 1
    shared = {
        orbit.name(i): len(true_matches(orbit, NUM_PHOTOS - 1, i)) for i in range(NUM_PHOTOS - 1)
    }
    # The neighbours on both sides of the circle.
    assert last.most_relevant in sorted(shared, key=shared.get, reverse=True)[:2]
    assert last.verified[0] == last.most_relevant
    assert len(last.verified) <= SessionOptions().pair_matching.num_matched
    names = [name for step in steps for name in step.registered]
    assert sorted(names) == [orbit.name(index) for index in range(NUM_PHOTOS)]
    assert last.num_registered == NUM_PHOTOS
    assert {"retrieve", "rerank", "match", "verify", "store", "map"} <= set(last.seconds)


def test_a_photo_that_can_be_located_is_matched_guided(session):
    output, steps, _ = session
    assert "guide" not in steps[1].seconds
    assert "guide" in steps[-1].seconds
    with pycolmap.Database.open(output / "database.db") as database:
        geometries = [
            database.read_two_view_geometry(NUM_PHOTOS, image_id)
            for image_id in range(1, NUM_PHOTOS)
            if database.exists_two_view_geometry(NUM_PHOTOS, image_id)
        ]
    assert (
        len(geometries)
        == len(steps[-1].verified)
        > SessionOptions().pair_matching.num_matched_first
    )
    # Each says where the photos stand to each other, in the same way whoever found it.
    for geometry in geometries:
        assert np.linalg.norm(geometry.cam2_from_cam1.translation) == pytest.approx(1)
        essential = pycolmap.essential_matrix_from_pose(geometry.cam2_from_cam1)
        cosine = (essential * geometry.E).sum() / np.linalg.norm(essential)
        assert abs(cosine) / np.linalg.norm(geometry.E) > 1 - ESSENTIAL_TOLERANCE


def test_a_listener_hears_of_everything_as_it_happens(orbit, tmp_path):
    heard: list[Event] = []
    unreadable = Skipped("broken.jpg", SkipReason.TRUNCATED, "half a JPEG")
    with Session(tmp_path / "out", options(), on_event=heard.append) as session:
        photos = [described(orbit, index) for index in range(4)]
        given = [session.add_extracted(photo) for photo in (*photos, unreadable)]
        before_the_end = len(heard)
        result = session.finish()
    assert isinstance(heard[0], SessionStarted)
    photos_heard = [e for e in heard if isinstance(e, PhotoAdded | Skipped)]
    assert photos_heard == given
    # What became of the models comes before the photo that brought it, and is in its result.
    brought = next(e for e in photos_heard if isinstance(e, PhotoAdded) and e.registered)
    at = heard.index(brought)
    assert tuple(heard[at - len(brought.events) : at]) == brought.events
    assert any(isinstance(event, ModelStarted) for event in brought.events)
    # The photo is acknowledged first, and then placed.
    placed = heard[at + 1 : at + 1 + len(brought.registered)]
    assert tuple(event.name for event in placed) == brought.registered
    assert all(isinstance(event, PhotoPlaced) and event.num_inliers > 30 for event in placed)
    waited = [event.name for event in heard if isinstance(event, PhotoWaiting)]
    assert waited == [photo.name for photo in given[:-1] if photo.name not in photo.registered]
    for photo in given[:-1]:
        refined = [e.seconds for e in photo.events if isinstance(e, ModelRefined)]
        assert photo.seconds.get("refine", 0) == pytest.approx(sum(refined))
    assert any(isinstance(event, ModelRefined) for event in heard[before_the_end:])
    assert result.summary.totals.num_registered == 4
    assert heard[-1] == SessionEnded(True, 4, 4, 1)
    lines = (tmp_path / "out" / "events.jsonl").read_text(encoding="utf-8").splitlines()
    assert len(lines) == len(heard)
    assert [json.loads(line)["event"] for line in lines][-1] == "session_ended"


def test_idle_time_is_used_once_and_no_photo_is_charged_with_it(orbit, tmp_path):
    heard: list[Event] = []
    unreadable = Skipped("broken.jpg", SkipReason.TRUNCATED, "half a JPEG")
    # Only idle time refines.
    never = MapperOptions(schedule=ScheduleOptions(growth=99, large_growth=99))
    rarely = options(atlas=AtlasOptions(mapper=never))
    with Session(tmp_path / "out", rarely, on_event=heard.append) as session:
        for index in range(5):
            session.add_extracted(described(orbit, index))

        def refined_while_idle(seconds: float) -> float:
            heard.clear()
            session.idle(seconds)
            return sum(event.seconds for event in heard if isinstance(event, ModelRefined))

        assert refined_while_idle(0.5) == 0
        assert refined_while_idle(60) > 0
        assert refined_while_idle(90) == 0
        # A file that is not used changes nothing either.
        session.add_extracted(unreadable)
        assert refined_while_idle(60) == 0
        added = session.add_extracted(described(orbit, 5))
        own = [event for event in heard if isinstance(event, ModelRefined)]
        assert [event for event in added.events if isinstance(event, ModelRefined)] == own
        assert added.seconds.get("refine", 0) == pytest.approx(sum(event.seconds for event in own))
        assert refined_while_idle(60) > 0


@pytest.mark.slow
def test_the_report_has_the_latencies_that_listeners_heard(tmp_path):
    heard: list[Event] = []
    small = options(max_image_size=400)
    with Session(tmp_path / "out", small, on_event=heard.append) as session:
        for photo in sorted((VILLAGE / "images").iterdir())[:4]:
            session.add(photo)
        totals = session.finish().summary.totals
    latencies = [event.latency_s for event in heard if isinstance(event, PhotoPlaced)]
    assert len(latencies) == totals.num_registered > 0
    assert totals.latency == Latency.of(latencies)


def test_reports_are_written(session):
    output, steps, _ = session
    lines = (output / "retrieval.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["name"] for line in lines] == [step.name for step in steps]
    report = json.loads((output / "report.json").read_text(encoding="utf-8"))
    assert report["totals"]["registered"] == NUM_PHOTOS
    assert all(row["registered"] and row["model"] == 0 for row in report["photos"])
    assert set(report["end"]["seconds"]) == {"look again", "finish", "export"}


def test_shuffled_photos_are_all_registered(orbit, tmp_path):
    order = list(range(NUM_PHOTOS))
    random.Random(1).shuffle(order)
    with Session(tmp_path / "out", options()) as session:
        for index in order:
            session.add_extracted(described(orbit, index))
        models = session.finish().models
    assert [model.num_registered for model in models] == [NUM_PHOTOS]
    assert position_errors_m(models[0].reconstruction, orbit).max() < POSITION_TOLERANCE_M


def test_two_places_give_two_models_the_largest_first(tmp_path):
    places = [make_scene(16, 400, seed=seed, layout="orbit") for seed in (2, 3)]
    with Session(tmp_path / "out", options()) as session:
        for index in range(10):
            for number, place in enumerate(places):
                if number == 1 or index < 6:
                    session.add_extracted(described(place, index, prefix=f"{number}/"))
        models = session.finish().models
    assert [model.path.name for model in models] == ["0", "1"]
    assert [registered_names([model.reconstruction]) for model in models] == [
        {f"1/{places[1].name(index)}" for index in range(10)},
        {f"0/{places[0].name(index)}" for index in range(6)},
    ]


def test_with_one_thread_the_database_is_the_same_to_the_bit(orbit, session, tmp_path):
    output, _, _ = session
    with Session(tmp_path / "out", options()) as other:
        for index in range(NUM_PHOTOS):
            other.add_extracted(described(orbit, index))
    assert tables(tmp_path / "out" / "database.db") == tables(output / "database.db")


def test_with_more_threads_the_models_are_as_true(orbit, tmp_path):
    """Refinement runs beside the photos then, and guides the matching of those that follow."""
    with Session(tmp_path / "out", options(2)) as session:
        for index in range(NUM_PHOTOS):
            session.add_extracted(described(orbit, index))
        models = session.finish().models
    assert [model.num_registered for model in models] == [NUM_PHOTOS]
    assert position_errors_m(models[0].reconstruction, orbit).max() < POSITION_TOLERANCE_M


def test_with_one_thread_the_models_are_the_same_to_the_bit(orbit, tmp_path):
    written = []
    for name in ("a", "b"):
        with Session(tmp_path / name, options()) as session:
            for index in range(8):
                session.add_extracted(described(orbit, index))
            session.finish()
        sparse = tmp_path / name / "sparse"
        written.append({p.relative_to(sparse): p.read_bytes() for p in sparse.rglob("*.*")})
    assert len(written[0]) >= 6
    assert written[0] == written[1]


def test_a_known_calibration_is_used(orbit, tmp_path):
    cameras = CameraOptions(params=tuple(orbit.camera.params))
    with Session(tmp_path / "out", options(cameras=cameras)) as session:
        session.add_extracted(described(orbit, 0))
    with pycolmap.Database.open(tmp_path / "out" / "database.db") as database:
        (camera,) = database.read_all_cameras()
    np.testing.assert_array_equal(camera.params, orbit.camera.params)
    assert camera.has_prior_focal_length


def test_duplicates_and_skipped_photos_take_no_image_id(orbit, tmp_path):
    photo = described(orbit, 0)
    copy = replace(photo, name="copy.jpg")
    unreadable = Skipped("broken.jpg", SkipReason.TRUNCATED, "half a JPEG")
    with Session(tmp_path / "out", options()) as session:
        steps = [session.add_extracted(p) for p in (photo, copy, unreadable, described(orbit, 1))]
        session.finish()
    assert (steps[0].image_id, steps[3].image_id) == (1, 2)
    assert steps[1] == Skipped("copy.jpg", SkipReason.DUPLICATE, "same file as 000000.jpg")
    assert steps[2] == unreadable
    rows = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))["photos"]
    assert [row["name"] for row in rows] == [step.name for step in steps]


def test_a_photo_that_is_no_file_is_skipped_by_add(tmp_path):
    with Session(tmp_path / "out", options()) as session:
        step = session.add(tmp_path / "none.jpg")
        assert step.name == "none.jpg"
        assert isinstance(step, Skipped)
        assert step.reason is SkipReason.UNREADABLE


def test_no_photos_no_models(tmp_path):
    with Session(tmp_path / "out", options()) as session:
        assert session.finish().models == ()
    assert json.loads((tmp_path / "out" / "report.json").read_text())["totals"]["photos"] == 0


def test_a_session_does_not_write_over_another(session):
    output, _, _ = session
    before = (output / "report.json").read_bytes()
    with pytest.raises(InputError, match="holds a reconstruction already"):
        Session(output, options())
    assert (output / "report.json").read_bytes() == before


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"threads": 0}, "threads must be at least 1, got 0"),
        ({"global_descriptor": "bag"}, "no global descriptor is called 'bag'"),
        ({"max_features": 0}, "max_features must be at least 1"),
        ({"max_image_size": 10}, "max_image_size must be at least"),
    ],
)
def test_values_out_of_range_are_refused_before_anything_is_written(tmp_path, wrong, message):
    with pytest.raises(ConfigError, match=message):
        Session(tmp_path / "out", SessionOptions(**({"global_descriptor": "vlad"} | wrong)))
    assert not (tmp_path / "out").exists()


def test_the_package_offers_the_session():
    from sfm_front import Session as Offered

    assert Offered is Session


@needs_blas
def test_what_is_open_is_closed_if_a_later_part_cannot_be_made(tmp_path, monkeypatch):
    """The limit on BLAS threads is the process's: a session that never began must not keep it."""

    def fail(_path):
        raise OSError("no database here")

    monkeypatch.setattr("sfm_front.session.parts.PhotoDatabase", fail)
    with several_threads() as before:
        with pytest.raises(OSError, match="no database here"):
            Session(tmp_path / "out", options(2))
        assert library_threads() == before


@needs_blas
@pytest.mark.parametrize("closed_first", [0, 1])
def test_two_sessions_at_once_share_the_limits(tmp_path, closed_first):
    names = [f"{seed}_0.png" for seed in range(6)]
    photos = [PhotoPath(path.name, path) for path in save(tmp_path / "photos", *names)]
    with several_threads() as before:
        sessions = [Session(tmp_path / name, options(2)) for name in ("first", "second")]
        streams = [session.add_all(photos) for session in sessions]
        for stream in streams:
            assert isinstance(next(stream), PhotoAdded)
        sessions[closed_first].close()
        assert library_threads() == (1, {1})
        sessions[1 - closed_first].close()
        assert library_threads() == before


def test_a_finished_session_takes_no_more_photos(orbit, tmp_path):
    with Session(tmp_path / "out", options(1)) as session:
        session.add_extracted(described(orbit, 0))
        session.finish()
        with pytest.raises(RuntimeError, match="finished"):
            session.add_extracted(described(orbit, 1))
        with pytest.raises(RuntimeError, match="finished"):
            session.finish()


def test_threads_and_seed_reach_every_part():
    made = SessionOptions(threads=3, seed=7)
    assert made.atlas.mapper.num_threads == 3
    assert made.atlas.mapper.seed == 7
    assert made.atlas.localization.seed == 7
    assert made.verification.seed == 7
