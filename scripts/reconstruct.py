"""Reconstruct a folder of photos: python scripts/reconstruct.py FOLDER [--output DIR] [options]."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli import main

if __name__ == "__main__":
    raise SystemExit(main(["reconstruct", *sys.argv[1:]]))
