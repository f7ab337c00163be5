"""The page in a real browser: it draws, and complains of nothing."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from helpers.report_making import Output, finished_output
from PIL import Image

from sfm_front.reports.html.page import write_page
from sfm_front.types import SkipReason

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
_PATIENCE_S = 120
NAME = "<script>console.error('run')</script>\"'.jpg".replace("/", "_")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium: apt-get install chromium"),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    output = Output(names={8: NAME}, skipped={f"2 {NAME}": SkipReason.DUPLICATE})
    return write_page(finished_output(tmp_path_factory.mktemp("browser") / "out", output))


def shown(page: Path, folder: Path, *, width: int = 1280, dark: bool = False):
    """(h, w, 3) of the page, and what the browser had to say of it."""
    file = folder / "shot.png"
    command = [
        CHROMIUM,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--hide-scrollbars",
        "--enable-logging=stderr",
        f"--user-data-dir={folder / 'profile'}",
        f"--window-size={width},2400",
        f"--screenshot={file}",
        *(["--force-dark-mode"] if dark else []),
        page.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE_S)
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return np.array(Image.open(file).convert("RGB")).astype(float), said


@pytest.mark.parametrize(("width", "dark"), [(1280, False), (1280, True), (390, False)])
def test_it_draws_and_complains_of_nothing(page, tmp_path, width, dark):
    pixels, said = shown(page, tmp_path, width=width, dark=dark)
    assert said == []
    assert pixels.shape == (2400, width, 3)
    assert (pixels.mean() < 60) if dark else (pixels.mean() > 200)
    # The points of the model, which are green.
    green = (pixels[..., 1] - pixels[..., [0, 2]].max(axis=-1)) > 30
    assert green.sum() > 1000


def test_a_script_would_have_been_noticed(page, tmp_path):
    worse = tmp_path / "worse.html"
    text = page.read_text(encoding="utf-8").replace("<body>", "<body><script>1</script>")
    worse.write_text(text, encoding="utf-8")
    _, said = shown(worse, tmp_path)
    assert "Content Security Policy" in said[0]
