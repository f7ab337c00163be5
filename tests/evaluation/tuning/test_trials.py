"""Sessions over described photos, with other options and in other orders."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers.benchmark_folder import noise_photos
from helpers.photo_stream import described

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.evaluation.tuning import trials
from sfm_front.evaluation.tuning.arrangements import arrange
from sfm_front.evaluation.tuning.option_paths import with_value
from sfm_front.evaluation.tuning.trials import describe, find_scenes, run_trial, try_scene
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session
from sfm_front.types import Skipped, SkipReason

NUM_PHOTOS = 24
OPTIONS = SessionOptions(global_descriptor="vlad", threads=1)


def nothing() -> None:
    pass


@pytest.fixture(scope="module")
def photos():
    orbit = make_scene(NUM_PHOTOS, 250, seed=1, layout="orbit")
    return [described(orbit, index) for index in range(NUM_PHOTOS)]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("orbit")
    make_scene(NUM_PHOTOS, 250, seed=1, layout="orbit").truth().write(folder)
    return BenchmarkScene(name="orbit", photos=folder, num_photos=NUM_PHOTOS, truth=folder)


def test_a_value_reaches_the_session(scene, photos):
    fewer = with_value(OPTIONS, "retrieval.candidates", 1)
    tried = try_scene(scene, photos, ["name"], [OPTIONS, fewer], nothing)
    now, other = tried.values()
    assert [key.options for key in tried] == [OPTIONS, fewer]
    # One pair per photo at most, and none for the first.
    assert other.verified_pairs < NUM_PHOTOS <= now.verified_pairs
    assert now.quality.registered == now.photos == NUM_PHOTOS
    assert now.quality.auc is not None
    assert now.quality.auc[2] > 0.9
    assert now.seconds > 0


def test_photos_arrive_as_arranged_and_absent_ones_are_not_missed(scene, photos, monkeypatch):
    arrived = []

    class Watched(Session):
        def add_extracted(self, photo):
            arrived.append(photo)
            return super().add_extracted(photo)

    monkeypatch.setattr(trials, "Session", Watched)
    counted = []
    trial = run_trial(scene, photos, "half", OPTIONS, lambda: counted.append(1))
    assert arrived == photos[::2]
    assert len(counted) == trial.photos == NUM_PHOTOS // 2
    assert trial.quality.registered == NUM_PHOTOS // 2
    # With the pairs of photos that never came it could not pass 66 / 276.
    assert trial.quality.auc[2] > 0.9
    arrived.clear()
    run_trial(scene, photos[:4], "shuffle-2", OPTIONS, nothing)
    assert arrived == arrange(photos[:4], "shuffle-2")


def test_a_photo_that_is_no_image_is_no_obstacle(scene):
    broken = Skipped("broken.jpg", SkipReason.NOT_AN_IMAGE)
    trial = run_trial(replace(scene, truth=None), [broken], "name", OPTIONS, nothing)
    assert (trial.photos, trial.quality.registered, trial.verified_pairs) == (1, 0, 0)
    assert trial.quality.auc is None


def test_photos_are_described_in_order_of_name_and_kept(tmp_path):
    noise_photos(tmp_path / "data" / "noise")
    (tmp_path / "data" / "noise" / "9.jpg").write_text("no image")
    (scene,) = find_scenes(tmp_path / "data", None)
    counted = []
    first, again = (
        describe(scene, tmp_path / "cache", OPTIONS, lambda: counted.append(1)) for _ in range(2)
    )
    assert [photo.name for photo in first] == ["0.jpg", "1.jpg", "2.jpg", "3.jpg", "9.jpg"]
    assert len(counted) == 10
    assert isinstance(first[4], Skipped)
    for one, other in zip(first[:4], again[:4], strict=True):
        assert (one.features.descriptors == other.features.descriptors).all()
        assert (one.global_vector == other.global_vector).all()


def test_scenes_are_the_folders_with_photos(tmp_path):
    for name in ("left", "right"):
        noise_photos(tmp_path / name / "images")
    (tmp_path / "empty").mkdir()
    assert [scene.name for scene in find_scenes(tmp_path, None)] == ["left", "right"]
    assert [scene.name for scene in find_scenes(tmp_path, ["right"])] == ["right"]
    with pytest.raises(ConfigError, match="no scene 'lift' in it; did you mean left"):
        find_scenes(tmp_path, ["right", "lift"])
    with pytest.raises(InputError, match="empty: no photo in it"):
        find_scenes(tmp_path, ["empty"])
    with pytest.raises(InputError, match="no folder in it holds photos"):
        find_scenes(tmp_path / "empty", None)
    with pytest.raises(InputError, match="no such folder"):
        find_scenes(tmp_path / "nowhere", None)
