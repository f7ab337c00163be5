"""Colours, and names that do no harm."""

from __future__ import annotations

import io

import pytest

from sfm_front.cli.terminal import painted, printable
from sfm_front.reports.lights import Level


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def colorful(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")


def test_a_verdict_has_the_color_of_its_light():
    texts = {level: painted("all", level, Terminal()) for level in Level}
    assert texts[Level.GOOD] == "\x1b[1;32mall\x1b[0m"
    assert texts[Level.UNKNOWN] == "all"
    assert len(set(texts.values())) == len(Level)


@pytest.mark.parametrize(("name", "value"), [("NO_COLOR", "1"), ("TERM", "dumb")])
def test_without_color_where_it_is_not_wanted(monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    assert painted("all", Level.BAD, Terminal()) == "all"


def test_an_empty_no_color_says_nothing(monkeypatch):
    """As https://no-color.org has it."""
    monkeypatch.setenv("NO_COLOR", "")
    assert painted("all", Level.BAD, Terminal()) != "all"


def test_a_file_gets_no_color():
    assert painted("all", Level.BAD, io.StringIO()) == "all"


def test_control_characters_are_spelled_out_and_letters_stay():
    assert printable("süd ✈\tb\n") == "süd ✈\tb\n"
    assert printable("\x1b[31m\x9b\r\u202e") == "\\x1b[31m\\x9b\\x0d\\x202e"
