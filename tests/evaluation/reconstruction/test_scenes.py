"""Scenes of the benchmark and their truth, and how models are judged by it."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers.benchmark_folder import CAMERAS, noise_photos, write_model
from helpers.model_building import looking
from PIL import ExifTags, Image

from sfm_front.errors import InputError
from sfm_front.evaluation.reconstruction.quality import assess
from sfm_front.evaluation.reconstruction.scenes import (
    BenchmarkScene,
    find_scene,
    limited_to,
    with_landmarks,
)


def some(*names):
    return {name: CAMERAS[name] for name in names}


@pytest.fixture
def photos(tmp_path):
    return noise_photos(tmp_path / "scene" / "images")


def test_a_scene_is_a_folder_of_photos_or_has_one(photos):
    for folder in (photos, photos.parent):
        scene = find_scene(folder)
        assert (scene.name, scene.num_photos) == ("scene", 4)
        assert scene.photos.resolve() == photos
        assert scene.truth is None
        assert scene.pairs is None


@pytest.mark.parametrize("place", ["scene/gt", "scene/images/gt"])
def test_truth_is_found_beside_and_among_the_photos(tmp_path, photos, place):
    truth = write_model(tmp_path / place, CAMERAS)
    assert find_scene(photos).truth == truth
    assert find_scene(photos.parent).truth == truth


def test_pairs_are_read_without_a_model(photos):
    (photos.parent / "gt").mkdir()
    listed = photos.parent / "gt" / "covisible_pairs.txt"
    listed.write_text("1.jpg 0.jpg\n\n2.jpg 3.jpg 0.7\n")
    scene = find_scene(photos)
    assert scene.truth is None
    assert scene.pairs == (("1.jpg", "0.jpg"), ("2.jpg", "3.jpg"))
    listed.write_text("1.jpg 0.jpg\n2.jpg\n")
    with pytest.raises(InputError, match="line 2: expected two photo names"):
        find_scene(photos)


def test_truth_that_is_no_model_is_refused(tmp_path, photos):
    write_model(tmp_path / "truth" / "0", CAMERAS)
    with pytest.raises(InputError, match=r"no COLMAP model in it; try .*truth.0"):
        find_scene(photos, tmp_path / "truth")
    assert find_scene(photos, tmp_path / "truth" / "0").truth == tmp_path / "truth" / "0"


def test_models_are_judged_together(tmp_path, photos):
    scene = BenchmarkScene(
        name="scene",
        photos=photos,
        num_photos=4,
        truth=write_model(tmp_path / "truth", CAMERAS),
        pairs=(("0.jpg", "1.jpg"), ("1.jpg", "2.jpg"), ("0.JPG", "2.jpg"), ("2.jpg", "3.jpg")),
    )
    folders = [
        write_model(tmp_path / "0", some("0.jpg", "1.jpg", "2.jpg")),
        write_model(tmp_path / "1", some("2.jpg", "3.jpg")),
    ]
    quality = assess(folders, scene)
    assert (quality.registered, quality.registered_in_all, quality.models) == (3, 4, 2)
    assert quality.pairs_joined == 1
    assert quality.auc == pytest.approx([1, 1, 1], abs=1e-5)
    assert (quality.points, quality.reprojection_error_px) == (0, None)
    first = assess(folders[:1], scene)
    assert first.pairs_joined == 0.75
    # Three of four errors are nought, one is infinite.
    assert first.auc == pytest.approx([0.75, 0.75, 0.75], abs=1e-5)


def test_photos_left_out_are_not_missed(tmp_path, photos):
    truth = write_model(tmp_path / "truth", CAMERAS)
    scene = BenchmarkScene(name="scene", photos=photos, num_photos=4, truth=truth)
    folder = write_model(tmp_path / "0", some("0.jpg", "2.jpg"))
    assert assess([folder], scene).auc == pytest.approx([1 / 6] * 3, abs=1e-5)
    limited = limited_to(scene, ["0.jpg", "2.JPG"])
    assert assess([folder], limited).auc == pytest.approx([1, 1, 1], abs=1e-5)
    listed = replace(scene, pairs=(("0.jpg", "1.jpg"), ("2.jpg", "0.jpg")))
    assert limited_to(listed, ["0.jpg", "2.jpg"]).pairs == (("2.jpg", "0.jpg"),)


def test_models_of_several_landmarks_are_counted(tmp_path):
    names = ["old_Bridge_12_7.jpg", "old_Bridge_3.jpg", "town/hall_1.JPG", "town/hall_22.png"]
    photos = tmp_path / "photos"
    for name in names:
        (photos / name).parent.mkdir(parents=True, exist_ok=True)
        (photos / name).touch()
    scene = with_landmarks(BenchmarkScene(name="scene", photos=photos, num_photos=4))
    assert list(scene.landmarks.values()) == 2 * ["old_bridge"] + 2 * ["town/hall"]
    cameras = dict(zip(names, CAMERAS.values(), strict=True))
    folders = [
        write_model(tmp_path / str(number), {name: cameras[name] for name in chosen})
        for number, chosen in enumerate((names[:2], names[2:], names[1:3]))
    ]
    assert assess(folders[:2], scene).mixed == 0
    assert assess(folders, scene).mixed == 1
    assert assess(folders, replace(scene, landmarks=None)).mixed is None


def test_gps_is_read_from_the_photos_of_the_largest_model(tmp_path):
    photos = noise_photos(tmp_path / "photos")
    scene = BenchmarkScene(name="scene", photos=photos, num_photos=4)
    # Metres. At the equator a degree of the meridian has 110 574, one of longitude 111 320.
    centres = [(0, 0, 100), (0, 30, 110), (40, 30, 100), (40, 0, 105)]
    cameras = {
        name: looking(centre, [0, 0, -1], [0, 1, 0])
        for name, centre in zip(CAMERAS, centres, strict=True)
    }
    folders = [
        write_model(tmp_path / "0", {"0.jpg": cameras["0.jpg"]}),
        write_model(tmp_path / "1", cameras),
    ]
    assert assess(folders, scene).gps_residual_m is None
    for name, (x, y, z) in zip(CAMERAS, centres, strict=True):
        exif = Image.Exif()
        place = {2: (0, 0, 3600 * y / 110574), 4: (10, 0, 3600 * x / 111320), 6: z}
        exif.get_ifd(ExifTags.IFD.GPSInfo).update({1: "N", 3: "E", **place})
        Image.open(photos / name).save(photos / name, exif=exif)
    assert assess(folders, scene).gps_residual_m < 0.01


def test_no_model_is_worth_nothing(tmp_path, photos):
    truth = write_model(tmp_path / "truth", CAMERAS)
    scene = BenchmarkScene(name="scene", photos=photos, num_photos=4, truth=truth)
    quality = assess([], scene)
    assert (quality.registered, quality.registered_in_all, quality.auc) == (0, 0, (0, 0, 0))
    scene = BenchmarkScene(name="scene", photos=photos, num_photos=4)
    assert assess([], scene).auc is None
