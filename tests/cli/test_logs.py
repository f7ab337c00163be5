"""-v and --log-file."""

from __future__ import annotations

import logging

import pytest

from sfm_front.cli.logs import logging_to
from sfm_front.errors import InputError

LOGGER = logging.getLogger("sfm_front.session.pair_matching")


def tell() -> None:
    LOGGER.debug("a pair")
    LOGGER.info("a step")
    LOGGER.warning("a problem")


@pytest.mark.parametrize(
    ("verbosity", "told"),
    [(0, "a problem\n"), (1, "a step\na problem\n"), (2, "a pair\na step\na problem\n")],
)
def test_the_screen_is_told_by_verbosity(capsys, verbosity, told):
    with logging_to(verbosity, None):
        tell()
    assert capsys.readouterr().err == told


def test_a_file_has_everything_and_the_screen_no_more_than_before(capsys, tmp_path):
    with logging_to(0, tmp_path / "log.txt"):
        tell()
    assert capsys.readouterr().err == "a problem\n"
    lines = (tmp_path / "log.txt").read_text(encoding="utf-8").splitlines()
    assert [line.split(" ", 2)[2] for line in lines] == [
        f"{level} sfm_front.session.pair_matching: {text}"
        for level, text in (("DEBUG", "a pair"), ("INFO", "a step"), ("WARNING", "a problem"))
    ]


def test_nothing_is_left_behind(tmp_path):
    package = logging.getLogger("sfm_front")
    before = package.level, list(package.handlers)
    with logging_to(2, tmp_path / "log.txt"):
        pass
    assert (package.level, package.handlers) == before


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match="Give another --log-file"), logging_to(0, tmp_path):
        pass
