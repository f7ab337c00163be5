"""``sfm-front report``: the page, made anew."""

from __future__ import annotations

import pytest
from helpers.report_making import finished_output

from sfm_front.cli.main import main


def test_the_page_is_made_anew(tmp_path, capsys):
    output = finished_output(tmp_path / "out")
    (output / "report.html").write_text("old")
    assert main(["report", str(output)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == f"wrote {output / 'report.html'}: open it in a browser"
    assert (output / "report.html").read_text().startswith("<!DOCTYPE html>")


@pytest.mark.parametrize("arguments", [[], ["--photos", "nowhere"]])
def test_what_cannot_be_is_said_in_a_line(tmp_path, capsys, arguments):
    output = finished_output(tmp_path / "out") if arguments else tmp_path
    assert main(["report", str(output), *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("sfm-front report: ")
    assert captured.err.count("\n") == 1
