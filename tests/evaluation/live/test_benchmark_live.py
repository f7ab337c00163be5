"""The benchmark of a watched folder, as it is run."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import pytest
from helpers.locations import SCRIPTS, VILLAGE

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.live.benchmark import run_live
from sfm_front.types import PhotoPath

NUM_PHOTOS = 4


def benchmark(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, SCRIPTS / "benchmark_live.py", *map(str, arguments)],
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize("interval_s", [-1.0, 8.0, float("nan")])
def test_the_session_must_not_end_between_two_photos(tmp_path, interval_s):
    with pytest.raises(ConfigError, match="below 8 s"):
        run_live(["never run"], [], tmp_path / "work", interval_s)
    assert not (tmp_path / "work").exists()


def test_a_session_that_fails_is_told_and_no_photo_is_sent(tmp_path):
    fails = [sys.executable, "-c", "print('no weights'); raise SystemExit(3)"]
    photos = [PhotoPath("a.jpg", VILLAGE / "images" / "0001.jpg")]
    with pytest.raises(InputError, match="0 of 1 photos and ended with status 3: no weights"):
        run_live(fails, photos, tmp_path, 0.1)


def test_without_photos_it_ends_in_one_line(tmp_path):
    done = benchmark(tmp_path)
    assert done.returncode == 2
    assert "no photo in it" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.slow
def test_photos_are_sent_to_a_watched_folder_and_timed(tmp_path):
    images = tmp_path / "few" / "images"
    images.mkdir(parents=True)
    for photo in sorted((VILLAGE / "images").iterdir())[:NUM_PHOTOS]:
        shutil.copy(photo, images)
    file = tmp_path / "live.json"
    done = benchmark(tmp_path / "few", "--interval", 0.2, "--max-image-size", 400, "--json", file)
    assert done.returncode == 0, done.stderr
    content = json.loads(file.read_text())
    names = [photo["name"] for photo in content["photos"]]
    assert names == [path.name for path in sorted(images.iterdir())]
    placed = [photo for photo in content["photos"] if photo["placed_s"] is not None]
    assert placed
    assert all(0 <= photo["noticed_s"] <= photo["placed_s"] for photo in placed)
    assert f"{len(placed)} of {NUM_PHOTOS} photos registered" in done.stdout
    assert all(name in done.stdout for name in ("copied to placed", "turn alone", "slowest"))
