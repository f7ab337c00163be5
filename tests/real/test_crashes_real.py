"""A real scene stopped at random moments, gone on with, and stopped again."""

from __future__ import annotations

import sys

import pytest
from helpers.locations import DATA, SCRIPTS

from sfm_front.evaluation.crashes.campaign import strike_at_random
from sfm_front.evaluation.reconstruction.scenes import find_scene

NUM_STRIKES = 10

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DATA.is_dir(), reason="needs ../shared/data"),
    pytest.mark.skipif(sys.platform == "win32", reason="needs the signals of POSIX"),
]


def test_ten_strikes_at_random_lose_nothing(tmp_path):
    output = tmp_path / "out"
    scene = find_scene(DATA / "strecha_fountain_P11")
    command = [
        *(sys.executable, str(SCRIPTS / "reconstruct.py"), str(scene.photos)),
        *("--output", str(output), "--global-descriptor", "vlad", "--snapshot-seconds", "1"),
        *("--max-image-size", "800", "--max-features", "2000", "--threads", "2"),
    ]
    report = strike_at_random(scene, command, output, NUM_STRIKES, seed=0, note=print)
    assert len(report.strikes) == NUM_STRIKES
    assert report.finished
    assert report.violations == []
