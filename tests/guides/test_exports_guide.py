"""The guide to exports: its commands run, and it leaves out no target."""

from __future__ import annotations

import re
import shlex

import pytest
from helpers.export_scenes import PLAIN, exact_model, model_folder, write_photos
from helpers.locations import ROOT

from sfm_front.cli.main import main
from sfm_front.exporters.registry import TARGETS

GUIDE = (ROOT / "sfm_front" / "guides" / "exports.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^sfm-front (.*)$", GUIDE, re.M)


def test_it_has_commands_and_all_targets():
    assert len(COMMANDS) > 4
    rows = re.findall(r"^\| `(\w[\w-]*)` \|[^|]*\|[^|]*\|[^|]*\|$", GUIDE, re.M)
    assert rows != []
    assert set(rows) == set(TARGETS)


def test_its_next_steps_are_those_that_are_said():
    for target in TARGETS.values():
        step = target.next_step.format(folder="DIR").removeprefix("cd DIR && ")
        assert any(part in GUIDE for part in (step, step.split(" --database")[0], "Load NView"))


@pytest.mark.parametrize("command", COMMANDS)
def test_its_commands_run(tmp_path, monkeypatch, capsys, command):
    output = tmp_path / "outputs" / "village"
    model_folder(output, exact_model())
    (tmp_path / "photos").mkdir()
    for name, path in write_photos(tmp_path / "taken").items():
        path.rename(tmp_path / "photos" / name)
    monkeypatch.chdir(tmp_path)
    arguments = shlex.split(command)
    if "--images" not in arguments:  # The village's database knows where its photos are.
        arguments += ["--images", "photos"]
    assert main(arguments) == 0
    assert f"{len(PLAIN)} photos" in capsys.readouterr().out
