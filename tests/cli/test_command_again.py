"""What is to be typed to go on."""

from __future__ import annotations

import shlex

import pytest

from sfm_front.cli.command_again import command_again


@pytest.mark.parametrize("flag", ["--overwrite", "--ov", "--over"])
def test_it_does_not_begin_anew(flag):
    given = ["reconstruct", "my photos", flag, "--output", "out's"]
    again = shlex.split(command_again(given))
    assert again == ["sfm-front", "reconstruct", "my photos", "--output", "out's"]
