"""``reconstruct --watch``: photos that appear in a folder."""

from __future__ import annotations

import json
import signal

import pytest
from helpers.reconstructing import after_photo, interrupt_after, reconstruct

pytestmark = pytest.mark.slow

WATCH = ("--watch", "--idle-timeout", "0.5")


def test_photos_are_taken_as_they_appear_in_a_folder(five, tmp_path, monkeypatch, capsys):
    """The last one comes once the others are in the model."""
    late = five / "0005.jpg"
    content = late.read_bytes()
    late.unlink()
    after_photo(monkeypatch, "0004.jpg", lambda: late.write_bytes(content))
    assert reconstruct(five, tmp_path / "out", *WATCH) == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert [row["name"] for row in report["photos"]] == [f"{n:04d}.jpg" for n in range(1, 6)]
    assert report["totals"]["registered"] == 5
    assert "from arrival to pose: median " in capsys.readouterr().out
    # Nothing new: it goes on with what is there, and ends.
    assert reconstruct(five, tmp_path / "out", *WATCH) == 0
    assert "continuing" in capsys.readouterr().out


@pytest.mark.usefixtures("handlers")
def test_watching_ends_at_a_signal_with_the_photos_taken_so_far(five, tmp_path, monkeypatch):
    interrupt_after(monkeypatch, 5, signal.SIGTERM)
    assert reconstruct(five, tmp_path / "out", "--watch") == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["totals"]["registered"] == 5


def test_a_watched_folder_that_never_comes_gives_no_model(tmp_path, capsys):
    assert reconstruct(tmp_path / "card", tmp_path / "out", *WATCH) == 1
    printed = capsys.readouterr().out
    assert f"{tmp_path / 'card'}: waiting for it" in printed
    assert "No model could be built: no photo came" in printed


def test_a_second_watched_folder_is_added_with_all_its_photos(five, tmp_path):
    """Its first photo has a name of its own, the next one a name that the first folder has."""
    second = tmp_path / "second"
    second.mkdir()
    (five / "0004.jpg").rename(second / "0000.jpg")
    (five / "0005.jpg").rename(second / "0001.jpg")
    assert reconstruct(five, tmp_path / "out", *WATCH) == 0
    assert reconstruct(second, tmp_path / "out", *WATCH) == 2
    assert reconstruct(second, tmp_path / "out", *WATCH, "--append") == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    names = [row["name"] for row in report["photos"] if row["registered"]]
    assert names == ["0001.jpg", "0002.jpg", "0003.jpg", "second/0000.jpg", "second/0001.jpg"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--watch", "--idle-timeout", "-1"], "idle_timeout_s must be at least 0"),
        (["--watch", "--idle-timeout", "nan"], "idle_timeout_s must be at least 0"),
        (["--idle-timeout", "3"], "--idle-timeout goes with --watch"),
        (["--watch", "--order", "time"], "leave --order out"),
    ],
)
def test_mistakes_in_watching_leave_what_is_there(five, tmp_path, capsys, given, message):
    earlier = tmp_path / "out" / "database.db"
    earlier.parent.mkdir()
    earlier.write_text("of an earlier run")
    try:
        status = reconstruct(five, tmp_path / "out", "--overwrite", *given)
    except SystemExit as left:  # As argparse does.
        status = left.code
    assert status == 2
    assert message in capsys.readouterr().err
    assert earlier.read_text() == "of an earlier run"
    assert list(earlier.parent.iterdir()) == [earlier]


def test_a_file_cannot_be_watched_and_nothing_is_written(five, tmp_path, capsys):
    assert reconstruct(five / "0001.jpg", tmp_path / "out", *WATCH) == 2
    assert "not a folder" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
