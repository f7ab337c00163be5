"""A process steps back behind others, and takes none of these with it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sfm_front.runtime import priority
from sfm_front.runtime.subprocess_env import module_environment

pytestmark = pytest.mark.skipif(not hasattr(os, "nice"), reason="no priorities of this kind")

STEP_BACK = """
import os
from pathlib import Path
from sfm_front.runtime.priority import let_others_first
let_others_first(7)
group = Path("/proc/self/autogroup")
print(os.nice(0), group.read_text() if group.exists() else "")
"""


def autogroup() -> str:
    """That of this process's session and its nice value; empty where there are none, which some
    kernels say by a file without content."""
    file = Path("/proc/self/autogroup")
    return file.read_text() if file.exists() else ""


has_autogroups = pytest.mark.skipif(not autogroup().strip(), reason="no autogroups")


def step_back(*, start_new_session: bool) -> list[str]:
    """Its nice value afterwards and, where there are such, its group and that of the group."""
    ran = subprocess.run(
        [sys.executable, "-c", STEP_BACK],
        env=module_environment(),
        start_new_session=start_new_session,
        capture_output=True,
        text=True,
        check=True,
    )
    return ran.stdout.split()


def test_a_process_steps_back() -> None:
    assert step_back(start_new_session=False)[0] == str(min(os.nice(0) + 7, 19))


@has_autogroups
def test_one_with_a_session_of_its_own_steps_back_with_it() -> None:
    assert step_back(start_new_session=True)[-1] == "7"


@has_autogroups
def test_a_shared_session_stays_as_it_is() -> None:
    before = autogroup()
    assert step_back(start_new_session=False)[1:] == before.split()
    assert autogroup() == before


def test_without_proc_nothing_breaks(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(priority, "_AUTOGROUP", tmp_path / "none" / "autogroup")
    monkeypatch.setattr(os, "getsid", lambda _: os.getpid())
    priority.let_others_first(0)
    assert not list(tmp_path.iterdir())
