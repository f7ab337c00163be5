"""The guide to the live page: its commands and its pictures are there."""

from __future__ import annotations

import re
import shlex

import pytest
from helpers.locations import ROOT
from PIL import Image

from sfm_front.cli.main import main

FOLDER = ROOT / "sfm_front" / "guides"
GUIDE = (FOLDER / "live.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^sfm-front (.*)$", GUIDE, re.M)


def test_its_pictures_are_small():
    names = re.findall(r"\]\((images/[^)]+)\)", GUIDE)
    assert len(names) == 2
    for name in names:
        assert (FOLDER / name).stat().st_size < 300_000
        assert Image.open(FOLDER / name).width >= 1000


@pytest.mark.parametrize("command", COMMANDS)
def test_its_commands_are_understood(tmp_path, monkeypatch, capsys, command):
    """They get as far as to miss the photos, or the session."""
    monkeypatch.chdir(tmp_path)
    assert main(shlex.split(command)) == 2
    assert "no such folder" in capsys.readouterr().err
