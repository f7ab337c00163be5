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


def test_its_table_has_all_targets_and_what_they_say_is_next():
    rows = re.findall(r"^\| `(\w[\w-]*)` \|[^|]*\|[^|]*\|([^|]*)\|$", GUIDE, re.M)
    assert [name for name, _ in rows] != []
    assert {name for name, _ in rows} == set(TARGETS)
    for name, cell in rows:
        assert cell.strip(" `…") in TARGETS[name].next_step.format(folder="DIR")


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
