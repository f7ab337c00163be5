"""Runs that a signal, a photo or a folder that goes away, or a closed pipe ends before time."""

from __future__ import annotations

import json
import os
import signal
import sys

import pycolmap
import pytest
from helpers.reconstructing import after_photo, interrupt_after, reconstruct

from sfm_front.errors import StorageError

pytestmark = pytest.mark.slow


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_finishes_with_the_photos_taken_so_far(five, tmp_path, monkeypatch, capfd, number):
    interrupt_after(monkeypatch, 4, number)
    handler = signal.getsignal(number)
    assert reconstruct(five, tmp_path / "out") == 0
    told = capfd.readouterr()
    assert "stopping: finishing with the photos taken so far" in told.err
    last = "stopped with 1 photo to go: the same command goes on from there"
    assert told.out.splitlines()[-1] == last
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert [row["name"] for row in report["photos"]] == [f"{n:04d}.jpg" for n in range(1, 5)]
    model = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert model.num_reg_images() == report["totals"]["registered"] >= 3
    page = (tmp_path / "out" / "report.html").read_text()
    assert "with 1 photo to go, finished with the others. To go on: <code>" in page
    assert signal.getsignal(number) is handler


@pytest.mark.usefixtures("handlers")
def test_ctrl_c_before_there_is_a_model_is_status_1(five, tmp_path, monkeypatch, capsys):
    interrupt_after(monkeypatch, 1, signal.SIGINT)
    assert reconstruct(five, tmp_path / "out") == 1
    assert "No model could be built" in capsys.readouterr().out
    left = {path.name for path in (tmp_path / "out" / "sparse").iterdir()}
    assert left == {"session.json", "georeference.json"}
    assert (tmp_path / "out" / "report.json").exists()


def test_what_ends_by_an_error_has_a_page_that_says_so(five, tmp_path, monkeypatch):
    def fail() -> None:
        raise StorageError("database.db: disk I/O error")

    after_photo(monkeypatch, "0003.jpg", fail)
    assert reconstruct(five, tmp_path / "out") == 2
    page = (tmp_path / "out" / "report.html").read_text()
    assert "before its end." in page
    assert "To go on: <code>sfm-front reconstruct" in page


def test_a_photo_that_is_deleted_before_it_is_read_is_named(five, tmp_path, monkeypatch, capsys):
    after_photo(monkeypatch, "0001.jpg", (five / "0005.jpg").unlink)
    assert reconstruct(five, tmp_path / "out", "--threads", "1") == 0
    gone = "skipped 0005.jpg: unreadable: No such file or directory"
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if line.startswith("skipped ")] == [gone]
    assert pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0").num_reg_images() == 4


def test_a_folder_that_goes_away_leaves_what_was_read(five, tmp_path, monkeypatch, capsys):
    """As a card that is pulled out."""
    after_photo(monkeypatch, "0003.jpg", lambda: five.rename(tmp_path / "away"))
    assert reconstruct(five, tmp_path / "out", "--threads", "1") == 0
    lines = capsys.readouterr().out.splitlines()
    assert "skipped 0005.jpg: unreadable: No such file or directory" in lines
    # The fourth may have been read already.
    model = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert model.num_reg_images() in (3, 4)


def test_a_closed_pipe_does_not_cost_the_models(five, tmp_path, monkeypatch):
    """As with ``| head -1``."""
    receiver, sender = os.pipe()
    os.close(receiver)
    with os.fdopen(sender, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        assert reconstruct(five, tmp_path / "out") == 0
    assert pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0").num_reg_images() == 5


@pytest.mark.usefixtures("handlers")
def test_an_interrupted_run_is_continued_by_the_same_command(five, tmp_path, monkeypatch, capsys):
    output = tmp_path / "out"
    with monkeypatch.context() as patched:
        interrupt_after(patched, 2, signal.SIGINT)
        reconstruct(five, output)
    capsys.readouterr()
    assert reconstruct(five, output) == 0
    told = capsys.readouterr().out
    assert "2 photos are in it" in told
    assert "photo 3 of 3" in told
    report = json.loads((output / "report.json").read_text())
    assert [row["name"] for row in report["photos"]] == [f"{n:04d}.jpg" for n in range(1, 6)]
    assert report["totals"]["registered"] == 5
