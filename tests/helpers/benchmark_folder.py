"""Photos for the reconstruction benchmark, and a command that pretends to reconstruct them."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pycolmap
from PIL import Image

from helpers.model_building import looking, make_model
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings

SETTINGS = BenchmarkSettings(threads=1, max_image_size_px=160, max_features=200)
CAMERAS = {f"{i}.jpg": looking([i, 0, 0], [0, 1, 0], [0, 0, 1]) for i in range(4)}


def write_model(folder: Path, cameras: Mapping[str, pycolmap.Rigid3d]) -> Path:
    """Write a model of these photos to a new folder; returns the folder."""
    folder.mkdir(parents=True)
    make_model(cameras).write(folder)
    return folder


def noise_photos(folder: Path) -> Path:
    """Write four photos of noise, with features but nothing in common; returns their folder."""
    folder.mkdir(parents=True)
    for i, name in enumerate(CAMERAS):
        coarse = np.random.default_rng(i).integers(0, 255, (15, 20, 3), dtype=np.uint8)
        Image.fromarray(coarse).resize((160, 120), Image.Resampling.BICUBIC).save(folder / name)
    return folder


FAKE = """
import json, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from helpers.model_building import looking, make_model
from sfm_front.reports.report_json import write_report
from sfm_front.reports.run_summary import PhotoOutcome, RunSummary, Totals
from sfm_front.types import Skipped, SkipReason
output = Path(sys.argv[sys.argv.index("--output") + 1])
for number, count in enumerate((3, 1)):
    folder = output / "sparse" / str(number)
    folder.mkdir(parents=True)
    cameras = {{f"{{i}}.jpg": looking([i, 0, 0], [0, 1, 0], [0, 0, 1]) for i in range(count)}}
    make_model(cameras).write(folder)
def photo(name, seconds):
    return PhotoOutcome(name, 1, None, None, 9, None, 0, 0, (), seconds, ())
photos = (
    photo("0.jpg", {{"sift": 0.5, "map": 0.25}}),
    Skipped("x.jpg", SkipReason.EMPTY_FILE),
    photo("1.jpg", {{"sift": 1.0}}),
)
by_stage = {{"sift": 1.5, "map": 0.25, "finish": 0.125}}
totals = Totals(3, 2, 0, 0, None, 1.0, by_stage, (), None, None)
write_report(output, RunSummary(photos, (), {{}}, (), totals))
(output / "arguments.json").write_text(json.dumps(sys.argv[1:]))
"""


def fake_command(folder: Path) -> list[str]:
    """A command that writes models and a report as ``reconstruct`` does, from no photos."""
    script = folder / "fake.py"
    script.write_text(FAKE.format(tests=str(Path(__file__).parents[1])))
    return [sys.executable, str(script)]
