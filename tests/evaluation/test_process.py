"""Commands that are run and measured."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from sfm_front.evaluation.process import measure


def test_a_process_is_measured_by_its_own_peak(tmp_path):
    block = 150 * 2**20
    code = f"import time; x = bytearray({block}); del x; time.sleep(0.3); print('a'); print('done')"
    measured = measure([sys.executable, "-c", code], tmp_path / "log.txt")
    assert measured.return_code == 0
    assert measured.last_line == "done"
    assert measured.wall_seconds >= 0.3
    if not Path("/proc/self/status").exists():
        pytest.skip("peak memory is read from /proc")
    assert block < measured.peak_memory_bytes < 2 * block


def test_the_peak_of_this_process_is_not_the_peak_of_its_child(tmp_path):
    large = bytearray(400 * 2**20)
    measured = measure([sys.executable, "-c", "import time; time.sleep(0.3)"], tmp_path / "log.txt")
    assert len(large) > (measured.peak_memory_bytes or 0)


def test_a_failing_process_tells_its_status_and_last_line(tmp_path):
    code = "import sys; print('first'); sys.exit('it broke')"
    measured = measure([sys.executable, "-c", code], tmp_path / "log.txt")
    assert (measured.return_code, measured.last_line) == (1, "it broke")
