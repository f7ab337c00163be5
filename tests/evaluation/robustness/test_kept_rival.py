"""COLMAP's models of some photos, kept."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from helpers.benchmark_folder import CAMERAS, SETTINGS, noise_photos, write_model

from sfm_front.errors import InputError
from sfm_front.evaluation.reconstruction.types import Run
from sfm_front.evaluation.robustness import kept_rival
from sfm_front.evaluation.robustness.kept_rival import rival_models
from sfm_front.photos.source import list_photos
from sfm_front.storage.colmap_models import read_model


@pytest.fixture
def photos(tmp_path):
    return list_photos(noise_photos(tmp_path / "photos"))


@pytest.fixture
def runs(monkeypatch):
    """The names of the photos in each run of a rival that writes a model of two photos."""
    seen = []

    def run_rival(name, images, workspace, settings):
        assert name == "exhaustive"
        seen.append([photo.name for photo in list_photos(images)])
        task = {"photos": str(images), "max_image_size_px": settings.max_image_size_px}
        task |= {"max_features": settings.max_features, "camera_mode": settings.camera_mode}
        write_model(workspace / "sparse" / "0", dict(list(CAMERAS.items())[:2]))
        (workspace / "task.json").write_text(json.dumps(task))
        return Run(wall_seconds=1.0, peak_memory_bytes=None, seconds_by_stage={"map": 1.0})

    monkeypatch.setattr(kept_rival, "run_rival", run_rival)
    return seen


def test_the_rival_sees_the_photos_that_are_left_and_runs_once(tmp_path, photos, runs):
    folder = tmp_path / "kept" / "scene" / "half"
    for _ in range(2):
        (model,) = rival_models(photos[::2], folder, SETTINGS)
        assert read_model(model).num_reg_images() == 2
    assert runs == [["0.jpg", "2.jpg"]]
    # What was built half-way is nowhere.
    assert [path.name for path in folder.parent.iterdir()] == ["half"]
    # The number of threads changes how long it takes, not what is built.
    rival_models(photos[::2], folder, replace(SETTINGS, threads=7))
    assert len(runs) == 1


@pytest.mark.parametrize(
    ("step", "settings", "message"),
    [
        (1, SETTINGS, "built of other photos"),
        (2, replace(SETTINGS, max_features=5000), "built with other settings"),
    ],
)
def test_what_is_kept_must_be_what_is_asked_for(tmp_path, photos, runs, step, settings, message):
    folder = tmp_path / "kept"
    rival_models(photos[::2], folder, SETTINGS)
    with pytest.raises(InputError, match=message):
        rival_models(photos[::step], folder, settings)
    assert len(runs) == 1


def test_a_folder_of_something_else_is_refused(tmp_path, photos):
    with pytest.raises(InputError, match="no results of COLMAP"):
        rival_models(photos, tmp_path / "photos", SETTINGS)


def test_a_rival_that_fails_leaves_nothing(tmp_path, photos, monkeypatch):
    failed = Run(wall_seconds=1.0, peak_memory_bytes=None, failure="exit status 1: no memory")
    monkeypatch.setattr(kept_rival, "run_rival", lambda *_: failed)
    with pytest.raises(InputError, match="exit status 1: no memory"):
        rival_models(photos, tmp_path / "kept" / "whole", SETTINGS)
    assert not list((tmp_path / "kept").iterdir())


def test_a_rival_that_finds_no_model_is_kept_too(tmp_path, photos):
    for _ in range(2):
        assert rival_models(photos[:2], tmp_path / "kept", SETTINGS) == []
