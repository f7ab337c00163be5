"""What importing the package does to the process, and on other systems."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from helpers.locations import ROOT

import sfm_front


def run(code: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    "imports",
    [
        "import sfm_front, pycolmap",
        "from sfm_front import Session",
        "import sfm_front.matching.verification",
        "from sfm_front.cli import main",
    ],
)
def test_compression_works_after_pycolmap_is_loaded(imports):
    """The wheel's own zlib breaks it in a process that has not loaded Python's before."""
    done = run(f"{imports}\nimport pycolmap, zlib\nzlib.compress(bytes(3_000_000))\nprint('whole')")
    assert done.stdout == "whole\n", done.stderr[-500:]


def test_the_session_needs_no_module_of_unix_alone():
    """As on Windows, which has none of these."""
    missing = ("resource", "fcntl", "pwd", "grp", "termios")
    code = f"import sys\nfor name in {missing}: sys.modules[name] = None\n"
    done = run(code + "from sfm_front import Session\nprint(Session.__name__)")
    assert done.stdout == "Session\n", done.stderr[-500:]


def test_every_public_name_is_there():
    for name in sfm_front.__all__:
        assert getattr(sfm_front, name) is not None
    assert set(sfm_front._MODULES) == set(sfm_front.__all__) - {"__version__"}
    with pytest.raises(AttributeError, match="no attribute 'Nothing'"):
        _ = sfm_front.Nothing
