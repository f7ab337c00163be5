"""Ours beside the rival, on what is left of a scene."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from helpers.benchmark_folder import CAMERAS, SETTINGS, noise_photos, write_model

from sfm_front.evaluation.reconstruction.quality import assess
from sfm_front.evaluation.reconstruction.scenes import find_scene
from sfm_front.evaluation.robustness import sparse
from sfm_front.evaluation.robustness.sparse import ORDERS, compare
from sfm_front.evaluation.tuning.trials import Trial
from sfm_front.session.options import SessionOptions
from sfm_front.types import Skipped, SkipReason

OPTIONS = SessionOptions(global_descriptor="vlad", threads=1)


@pytest.fixture
def scene(tmp_path):
    noise_photos(tmp_path / "data" / "scene" / "images")
    write_model(tmp_path / "data" / "scene" / "gt", CAMERAS)
    return find_scene(tmp_path / "data" / "scene")


def test_each_order_is_set_against_the_rival(tmp_path, scene, monkeypatch):
    built = write_model(tmp_path / "rival", {n: CAMERAS[n] for n in ("0.jpg", "2.jpg")})
    asked, tried = [], []

    def rival_models(photos, folder, _):
        asked.append(([photo.name for photo in photos], folder))
        return [built]

    def run_trial(scene, _, arrangement, __, ___):
        tried.append(arrangement)
        registered = 1 if "shuffle" in arrangement else 2
        quality = replace(assess([], scene), registered=registered)
        return Trial(
            scene=scene.name,
            arrangement=arrangement,
            photos=2,
            quality=quality,
            verified_pairs=0,
            seconds=1.0,
        )

    monkeypatch.setattr(sparse, "rival_models", rival_models)
    monkeypatch.setattr(sparse, "run_trial", run_trial)
    kept = tmp_path / "kept"
    found = compare(scene, [], "half", kept, SETTINGS, OPTIONS, lambda: None)
    assert asked == [(["0.jpg", "2.jpg"], kept / "scene" / "half")]
    assert tried == ["half-name", "half-shuffle-1", "half-shuffle-2"]
    assert (found.photos, found.rival.registered) == (2, 2)
    # Of the two that are left the rival has all, and the other two are not missed.
    assert found.rival.auc == pytest.approx([1, 1, 1], abs=1e-5)
    assert found.misses() == ["shuffle-1", "shuffle-2"]
    assert json.loads(json.dumps(found.as_dict()))["misses"] == found.misses()


def test_photos_without_overlap_are_a_draw(tmp_path, scene):
    described = [Skipped(name, SkipReason.NOT_AN_IMAGE) for name in CAMERAS]
    counted = []
    found = compare(
        scene, described, "third", tmp_path / "kept", SETTINGS, OPTIONS, lambda: counted.append(1)
    )
    assert found.rival.registered == 0
    assert [trial.quality.registered for trial in found.ours.values()] == [0, 0, 0]
    assert found.misses() == []
    assert len(counted) == found.photos * len(ORDERS) == 6
