"""What the benchmark runs: the rivals, ours, and SIFT alone."""

from __future__ import annotations

import json
import sys

import pytest
from helpers.benchmark_folder import SETTINGS, fake_command, noise_photos
from PIL import ExifTags, Image

from sfm_front.errors import ConfigError
from sfm_front.evaluation.reconstruction.ours import run_ours
from sfm_front.evaluation.reconstruction.rivals import RIVALS, run_rival
from sfm_front.evaluation.reconstruction.sift_alone import sift_alone_seconds
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings


@pytest.fixture
def photos(tmp_path):
    return noise_photos(tmp_path / "scene" / "images")


def test_a_rival_that_finds_no_model_says_so(tmp_path, photos):
    run = run_rival("exhaustive", photos, tmp_path / "work", SETTINGS)
    assert run.models == ()
    assert "no initial pair" in run.failure
    assert set(run.seconds_by_stage) == {"extract", "match", "map"}
    assert 0 < sum(run.seconds_by_stage.values()) < run.wall_seconds
    assert (tmp_path / "work" / "database.db").is_file()


@pytest.mark.parametrize("orientation", [None, 1])
def test_spatial_pairing_without_positions_says_so(tmp_path, photos, orientation):
    if orientation is not None:  # of which pycolmap makes a prior for the direction of gravity
        exif = Image.Exif()
        exif[ExifTags.Base.Orientation] = orientation
        for photo in photos.iterdir():
            Image.open(photo).save(photo, exif=exif)
    run = run_rival("spatial", photos, tmp_path / "work", SETTINGS)
    assert run.failure == "these photos have no GPS position"


def test_an_unknown_rival_is_refused(tmp_path, photos):
    with pytest.raises(ConfigError, match=", ".join(RIVALS)):
        run_rival("transitive", photos, tmp_path / "work", SETTINGS)
    assert not (tmp_path / "work").exists()


def test_ours_is_started_with_the_settings_and_its_report_is_read(tmp_path, photos):
    settings = BenchmarkSettings(threads=3, max_features=123, order="random", seed=5)
    run = run_ours(fake_command(tmp_path), photos, tmp_path / "work", settings)
    assert run.failure is None
    assert run.photo_seconds == (0.75, 1.0)
    assert run.seconds_by_stage == {"sift": 1.5, "map": 0.25, "finish": 0.125}
    assert [folder.name for folder in run.models] == ["0", "1"]
    given = json.loads((tmp_path / "work" / "output" / "arguments.json").read_text())
    assert given[0] == str(photos)
    options = dict(zip(given[1::2], given[2::2], strict=True))
    del options["--output"]
    assert options == {
        "--max-image-size": "1600",
        "--max-features": "123",
        "--threads": "3",
        "--camera-mode": "auto",
        "--order": "random",
        "--seed": "5",
    }


def test_ours_that_fails_says_why(tmp_path, photos):
    command = [sys.executable, "-c", "import sys; sys.exit('no pair of photos overlaps')"]
    run = run_ours(command, photos, tmp_path / "work", SETTINGS)
    assert run.failure == "exit status 1: no pair of photos overlaps"
    assert run.models == ()


def test_sift_alone_counts_every_photo_that_can_be_read(tmp_path, photos):
    (photos / "broken.jpg").write_bytes(b"no image")
    assert 0 < sift_alone_seconds(photos, tmp_path / "work", SETTINGS) < 60
