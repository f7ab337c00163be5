"""The page of a session that still runs, or was stopped."""

from __future__ import annotations

import shutil
import threading
import time
from itertools import islice

import pytest
from helpers.live_session import HOSTILE, orbit, photos_of, run_session
from helpers.positioned_stream import options

from sfm_front.errors import InputError
from sfm_front.reports.html.material_reading import read_material
from sfm_front.reports.html.page import write_page
from sfm_front.reports.unfinished import Moment
from sfm_front.session.session import Session
from sfm_front.types import Skipped, SkipReason

NUM_PHOTOS = 10
NUM_WRITTEN = 7
NEVER = 1e9


@pytest.fixture
def photos(tmp_path):
    flight = photos_of(orbit(24), tmp_path / "photos", {1: HOSTILE})
    return list(islice(flight, NUM_PHOTOS))


def text_of(output) -> str:
    return write_page(output).read_text(encoding="utf-8")


def test_a_session_that_runs_has_a_page_of_what_is_written(tmp_path, photos):
    output = tmp_path / "out"
    with Session(output, options()) as session:
        session.add_extracted(Skipped("torn.jpg", SkipReason.TRUNCATED, "cut off"))
        for photo in photos[:NUM_WRITTEN]:
            session.add_extracted(photo)
        session._write_snapshot()
        for photo in photos[NUM_WRITTEN:]:
            session.add_extracted(photo)
        page, material = text_of(output), read_material(output)
    assert "Not finished yet: this is how far it was at" in page
    assert '<meta http-equiv="refresh"' in page
    assert "<img src=x" not in page
    summary = material.summary
    assert [one.name for one in summary.photos][:2] == ["torn.jpg", photos[0].name]
    assert [one.name for one in summary.skipped] == ["torn.jpg"]
    assert len(summary.used) == Moment.of(output).num_photos == NUM_WRITTEN
    assert summary.models[0].num_registered == summary.totals.num_registered == NUM_WRITTEN
    assert summary.totals.mean_reprojection_error_px < 1
    assert all("match" in one.seconds for one in summary.used[1:])
    assert summary.cameras[0].focal_px > 0
    assert "3 photos have come since the models were written last" in page


def test_before_the_first_model_is_written_there_is_a_page(tmp_path, photos):
    output = tmp_path / "out"
    with Session(output, options(snapshot_seconds=NEVER)) as session:
        session._snapshots._began += NEVER  # Nor one early on.
        session._snapshots._last += NEVER
        for photo in photos[:5]:
            session.add_extracted(photo)
        page, material = text_of(output), read_material(output)
    assert "There is no model yet." in page
    reasons = {one.why_not for one in material.summary.used}
    assert "placed in a model that is still to be written" in reasons


def test_a_session_that_was_stopped_is_said_to_be(tmp_path, photos):
    page = text_of(run_session(tmp_path / "out", iter(photos[:4]), finish=False))
    assert "before its end. The same command goes on" in page
    assert "Not finished" not in page
    assert '<meta http-equiv="refresh"' not in page


def test_a_session_that_was_killed_is_said_to_be(tmp_path, photos, monkeypatch):
    output = tmp_path / "out"
    run_session(output, iter(photos[:4]), finish=False)
    log = output / "events.jsonl"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[:-1]))
    monkeypatch.setattr("sfm_front.reports.standing._SILENT_S", 0.0)
    page = text_of(output)
    assert "Broken off: nothing was heard after" in page
    assert "Not finished" not in page
    assert '<meta http-equiv="refresh"' not in page


def test_one_that_was_stopped_and_finished_says_what_is_left(tmp_path, photos):
    output = tmp_path / "out"
    command = "sfm-front reconstruct '<script>'"
    with Session(output, options(), command=command) as session:
        for photo in photos[:5]:
            session.add_extracted(photo)
        session.finish(num_left=3)
    page = text_of(output)
    assert "with 3 photos to go, finished with the others. To go on: <code>" in page
    assert "<script" not in page
    assert "All 5 photos are in one model" in page


def test_one_that_goes_on_is_not_shown_as_it_ended_before(tmp_path, photos):
    output = run_session(tmp_path / "out", iter(photos[:5]))
    assert "Not finished" not in text_of(output)
    with Session(output, options(), resume=True) as session:
        session.add_extracted(photos[5])
        assert "Not finished yet" in text_of(output)
        session.finish()
        assert "Not finished" not in text_of(output)
    assert len(read_material(output).summary.used) == 6


def test_the_step_of_its_end_is_told(tmp_path, photos):
    output = tmp_path / "out"
    pages = []

    def listen(event: object) -> None:
        if type(event).__name__ == "FinishingBegan" and output.joinpath("sparse").is_dir():
            pages.append(text_of(output))

    with Session(output, options(), on_event=listen) as session:
        for photo in photos[:5]:
            session.add_extracted(photo)
        session._write_snapshot()
        session.finish()
    assert any("finishing 2 of 6: refining the models" in page for page in pages)


def test_models_that_are_replaced_meanwhile_are_read_whole(tmp_path, photos):
    output = tmp_path / "out"
    with Session(output, options()) as session:
        for photo in photos[:6]:
            session.add_extracted(photo)
        session._write_snapshot()
    sparse, other = output / "sparse", tmp_path / "other"
    shutil.copytree(sparse, other)
    done = threading.Event()

    def replace() -> None:
        while not done.wait(0.1):
            shutil.copytree(other, output / "sparse.new", copy_function=shutil.copyfile)
            sparse.rename(output / "sparse.old")
            (output / "sparse.new").rename(sparse)
            shutil.rmtree(output / "sparse.old")

    thread = threading.Thread(target=replace)
    thread.start()
    try:
        for _ in range(10):
            # None are there for a moment, which is no other than before the first were written.
            material = read_material(output)
            assert [model.num_reg_images() for model in material.models] in ([], [6])
            time.sleep(0.03)
    finally:
        done.set()
        thread.join()


def test_models_that_never_rest_are_a_line(tmp_path, photos, monkeypatch):
    output = run_session(tmp_path / "out", iter(photos[:5]), finish=False)
    moments = iter(range(100))
    monkeypatch.setattr("sfm_front.reports.html.material_reading._PAUSE_S", 0)
    monkeypatch.setattr(Moment, "of", classmethod(lambda cls, _: cls(next(moments))))
    with pytest.raises(InputError, match="Try again"):
        read_material(output)
