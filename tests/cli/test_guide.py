"""Guides that ship with the package."""

from __future__ import annotations

import pytest
from helpers.locations import ROOT

from sfm_front.cli.main import main

GUIDES = ROOT / "sfm_front" / "guides"


def test_without_a_name_all_are_listed_with_their_titles(capsys):
    assert main(["guide"]) == 0
    rows = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()]
    assert [name for name, _ in rows] == sorted(file.stem for file in GUIDES.glob("*.md"))
    for name, title in rows:
        assert (GUIDES / f"{name}.md").read_text(encoding="utf-8").startswith(f"# {title}\n")


@pytest.mark.parametrize("name", [file.stem for file in GUIDES.glob("*.md")])
def test_a_guide_is_printed_as_it_is(capsys, name):
    assert main(["guide", name]) == 0
    printed = capsys.readouterr().out
    assert printed.strip() == (GUIDES / f"{name}.md").read_text(encoding="utf-8").strip()


def test_another_name_is_a_mistake_that_names_the_guides(capsys):
    with pytest.raises(SystemExit) as left:
        main(["guide", "gsp"])
    assert left.value.code == 2
    assert "'gps'" in capsys.readouterr().err
