"""``sfm-front report``: the page, made anew."""

from __future__ import annotations

from itertools import islice

import pytest
from helpers.live_session import orbit, photos_of, run_session
from helpers.report_making import finished_output

from sfm_front.cli.main import main


def test_the_page_is_made_anew(tmp_path, capsys):
    output = finished_output(tmp_path / "out")
    (output / "report.html").write_text("old")
    assert main(["report", str(output)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == f"wrote {output / 'report.html'}: open it in a browser"
    assert (output / "report.html").read_text().startswith("<!DOCTYPE html>")


def test_of_a_session_that_was_stopped_there_is_one_too(tmp_path, capsys):
    photos = islice(photos_of(orbit(24), tmp_path / "photos"), 4)
    output = run_session(tmp_path / "out", photos, finish=False)
    assert main(["report", str(output)]) == 0
    assert "report.html" in capsys.readouterr().out
    page = (output / "report.html").read_text(encoding="utf-8")
    assert "before its end. The same command goes on." in page


@pytest.mark.parametrize("arguments", [[], ["--photos", "nowhere"]])
def test_what_cannot_be_is_said_in_a_line(tmp_path, capsys, arguments):
    output = finished_output(tmp_path / "out") if arguments else tmp_path
    assert main(["report", str(output), *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("sfm-front report: ")
    assert captured.err.count("\n") == 1
