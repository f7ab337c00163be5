"""Folders of the repository and of test data."""

from __future__ import annotations

from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
ROOT = TESTS.parent
SCRIPTS = ROOT / "scripts"
SAMPLES = ROOT / "data_samples"
VILLAGE = SAMPLES / "village"
SHARED = ROOT.parent / "shared"
DATA = SHARED / "data"
