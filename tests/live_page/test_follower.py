"""What is known of an output while a session writes it, and after."""

from __future__ import annotations

import json
from datetime import datetime, timedelta, timezone

import numpy as np
import pycolmap
import pytest
from helpers.live_session import HOSTILE, orbit, photos_of, run_session
from helpers.model_building import looking, make_model
from helpers.positioned_stream import options

from sfm_front.exporters.colmap import export_models
from sfm_front.live_page.follower import OutputFollower
from sfm_front.reports.standing import Standing
from sfm_front.reports.story import PhotoState
from sfm_front.session.session import Session
from sfm_front.storage.session_lock import SessionLock

NUM_PHOTOS = 12
POSITIONS = {"num_used": 5, "num_positions": 5, "scale_sigma": 0.1, "origin": [1, 2, 3]}


def names(number: int, prefix: str = "") -> list[str]:
    return [f"{prefix}{place}.jpg" for place in range(number)]


def model_of(names: list[str]) -> pycolmap.Reconstruction:
    cameras = {n: looking([i, 0, 5], [0, 0.5, -1], [0, 0, 1]) for i, n in enumerate(names)}
    points = np.random.default_rng(0).normal(size=(40, 3))
    return make_model(cameras, points)


def write_models(output, *models: pycolmap.Reconstruction) -> None:
    """As a snapshot has them; ids from 1 on."""
    state = {"models": [{"model_id": number + 1} for number in range(len(models))]}
    export_models(list(models), None, output / "sparse", point_clouds=False, state=state)


class Log:
    """An ``events.jsonl``, a second between its lines."""

    def __init__(self, output, *, ago_s: float = 0.0) -> None:
        output.mkdir(exist_ok=True)
        self._file = output / "events.jsonl"
        self._now = datetime.now(timezone.utc) - timedelta(seconds=ago_s)

    def tell(self, event: str, **fields: object) -> None:
        self._now += timedelta(seconds=1)
        content = {"v": 1, "time": self._now.isoformat(), "event": event, **fields}
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(content) + "\n")

    def place(self, name: str, image_id: int, model_id: int = 1) -> None:
        self.tell(
            "photo_placed",
            name=name,
            image_id=image_id,
            model_id=model_id,
            quaternion_xyzw=[0, 0, 0, 1],
            translation=[0, 0, 7],
            camera="SIMPLE_RADIAL",
            params=[500, 320, 240, 0],
            num_inliers=90,
            latency_s=None,
        )


def test_a_real_session_is_told_as_it_was(tmp_path):
    scene = orbit(NUM_PHOTOS)
    output = run_session(tmp_path / "out", photos_of(scene, tmp_path / "photos", {2: HOSTILE}))
    seen = OutputFollower(output).look()
    assert seen.story.ended is True
    assert seen.verdict is not None
    assert seen.verdict.sentence.startswith(f"All {NUM_PHOTOS} photos are in one model")
    assert [len(shape.image_ids) for shape in seen.models] == [NUM_PHOTOS]
    assert len(seen.outcomes) == NUM_PHOTOS
    assert {one.state for one in seen.outcomes.values()} == {PhotoState.PLACED}
    assert list(seen.outcomes)[2] == HOSTILE
    photo = seen.outcomes[HOSTILE].photo
    assert photo.image_id == 3
    assert photo.num_keypoints > 100
    assert sum(photo.links.values()) > 30
    # The pose in its event is that of a camera of the same shape as in the model.
    shape = seen.models[0]
    size = shape.sizes[list(shape.names).index(HOSTILE)]
    assert photo.pose.size == pytest.approx(size, rel=0.1)


def test_nothing_new_is_nothing(tmp_path):
    output = run_session(tmp_path / "out", photos_of(orbit(5), tmp_path / "photos"))
    follower = OutputFollower(output)
    assert follower.look() is not None
    assert follower.look() is None


def test_photos_are_seen_before_their_models_are_written(tmp_path):
    photos = photos_of(orbit(NUM_PHOTOS), tmp_path / "photos", has_positions=False)
    follower = OutputFollower(tmp_path / "out")
    assert follower.look().outcomes == {}
    with Session(tmp_path / "out", options(snapshot_seconds=1e-9)) as session:
        for photo in photos:
            session.add_extracted(photo)
        seen = follower.look()
        placed = seen.named(PhotoState.PLACED)
        assert len(placed) > 3
        held = {name for shape in seen.models for name in shape.names}
        fresh = {photo.name for photo in seen.fresh}
        assert not held & fresh
        assert {one.photo.name for one in placed if one.model is not None} == held | fresh
        session.finish()
    assert follower.look().fresh == []


def test_fresh_poses_hold_until_their_frame_changes(tmp_path):
    log = Log(tmp_path / "out")
    write_models(tmp_path / "out", model_of(names(3)))
    log.place("new.jpg", 4)
    follower = OutputFollower(tmp_path / "out")
    seen = follower.look()
    assert [photo.name for photo in seen.fresh] == ["new.jpg"]
    assert seen.outcomes["new.jpg"].model == 0
    log.tell("georeferenced", model_id=1, state="provisional", reasons=[], **POSITIONS)
    assert len(follower.look().fresh) == 1
    log.tell("georeferenced", model_id=1, state="metric", reasons=[], **POSITIONS)
    seen = follower.look()
    assert seen.fresh == []
    assert seen.outcomes["new.jpg"].state is PhotoState.PLACED
    assert seen.outcomes["new.jpg"].model is None


def test_a_photo_whose_model_is_gone_waits(tmp_path):
    log = Log(tmp_path / "out", ago_s=60)
    log.place("lost.jpg", 9, model_id=3)
    write_models(tmp_path / "out", model_of(names(3)))
    outcome = OutputFollower(tmp_path / "out").look().outcomes["lost.jpg"]
    assert outcome.state is PhotoState.WAITING
    assert outcome.reason == "its model was given up"


def test_few_links_are_weak(tmp_path):
    log = Log(tmp_path / "out", ago_s=60)
    candidates = []
    for image_id, name in enumerate(names(5), start=1):
        log.tell(
            "photo_added",
            name=name,
            image_id=image_id,
            num_keypoints=100,
            candidates=candidates[: 1 if image_id == 5 else 4],
            num_points=10,
            seconds={},
        )
        log.place(name, image_id)
        candidates = [
            *candidates,
            {"name": name, "cosine": 0.5, "inliers": 20, "verified": True},
        ]
    write_models(tmp_path / "out", model_of(names(5)))
    weak = [one.photo.name for one in OutputFollower(tmp_path / "out").look().weak]
    assert weak == ["4.jpg"]


def test_a_killed_session_is_noticed_though_it_tells_nothing(tmp_path):
    output = tmp_path / "out"
    options = {"second_look": {"min_pairs": 3}}
    Log(output, ago_s=60).tell("session_started", options=options, num_photos=0)
    follower = OutputFollower(output)
    with SessionLock(output):
        assert follower.look().standing is Standing.RUNS
        assert follower.look() is None
    assert follower.look().standing is Standing.BROKEN_OFF
    assert follower.look() is None
    with SessionLock(output):  # It goes on.
        assert follower.look().standing is Standing.RUNS


def test_damaged_events_are_passed_over(tmp_path):
    log = Log(tmp_path / "out")
    log.tell("photo_placed", name="a.jpg")
    log.tell("photo_added")
    log.tell("__init__", name="b.jpg")
    log.tell("models_joined", num_registered=3)
    log.tell("session_started", options={"second_look": {"min_pairs": []}}, num_photos=0)
    log.tell("photo_waiting", name="c.jpg", image_id=3, reason="why")
    outcomes = OutputFollower(tmp_path / "out").look().outcomes
    assert outcomes["c.jpg"].reason == "why"


def test_another_session_in_the_same_place_begins_anew(tmp_path):
    output = tmp_path / "out"
    log = Log(output)
    log.place("old.jpg", 1)
    follower = OutputFollower(output)
    assert "old.jpg" in follower.look().outcomes
    (output / "events.jsonl").unlink()
    Log(output).tell("photo_arrived", name="new.jpg")
    assert list(follower.look().outcomes) == ["new.jpg"]


def test_models_that_are_being_replaced_are_looked_at_later(tmp_path):
    output = tmp_path / "out"
    write_models(output, model_of(names(3)))
    images = output / "sparse" / "0" / "images.bin"
    whole = images.read_bytes()
    images.write_bytes(whole[:-9])
    follower = OutputFollower(output)
    assert follower.look().models == []
    images.write_bytes(whole)
    assert len(follower.look().models) == 1
    write_models(output, model_of(names(4)), model_of(names(2, "b")))
    assert [len(shape.image_ids) for shape in follower.look().models] == [4, 2]


def test_a_model_of_another_program_is_shown(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()
    model_of(names(3)).write_binary(folder)
    seen = OutputFollower(folder).look()
    assert len(seen.models[0].image_ids) == 3
    assert {one.state for one in seen.outcomes.values()} == {PhotoState.PLACED}
