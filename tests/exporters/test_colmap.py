"""Models on disk: complete, coloured, and never half written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import centre_of, true_matches

from sfm_front.errors import StorageError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.exporters.colmap import (
    export_models,
    first_name_lost_in_text,
    recover_models,
)

BINARY = {"cameras.bin", "frames.bin", "images.bin", "points3D.bin", "rigs.bin", "points3D.ply"}
TEXT = {"cameras.txt", "frames.txt", "images.txt", "points3D.txt", "rigs.txt"}
POSITION_TOLERANCE = 1e-9


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(12, 150, seed=1, layout="orbit")


def make_model(scene: SyntheticScene, num_images: int) -> pycolmap.Reconstruction:
    """The true poses of the first photos, image ids from 1, with the points of the first pair."""
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(scene.camera)
    for index in range(num_images):
        image = pycolmap.Image(
            name=scene.name(index),
            keypoints=scene.photo(index).features.keypoints[:, :2].astype(float),
            camera_id=1,
            image_id=index + 1,
        )
        model.add_image_with_trivial_frame(image, scene.cams_from_world[index])
    ids = scene.photo(0).point_ids
    for first, second in true_matches(scene, 0, 1):
        track = pycolmap.Track(
            [pycolmap.TrackElement(1, int(first)), pycolmap.TrackElement(2, int(second))]
        )
        model.add_point3D(scene.points[ids[first]], track)
    return model


def colors_of(scene: SyntheticScene, num_images: int) -> dict[int, np.ndarray]:
    return {index + 1: scene.photo(index).features.colors for index in range(num_images)}


def files_below(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_models_are_written_in_the_order_given(orbit, tmp_path):
    models = [make_model(orbit, count) for count in (4, 2, 3)]
    summaries = export_models(models, colors_of(orbit, 4), tmp_path / "sparse")
    assert sorted(path.name for path in (tmp_path / "sparse").iterdir()) == ["0", "1", "2"]
    assert [path.name for path in tmp_path.iterdir()] == ["sparse"]
    for number, (model, summary) in enumerate(zip(models, summaries, strict=True)):
        assert summary.path == tmp_path / "sparse" / str(number)
        assert {path.name for path in summary.path.iterdir()} == BINARY
        read = pycolmap.Reconstruction(summary.path)
        assert read.num_reg_images() == model.num_reg_images() == summary.num_registered
        assert read.num_points3D() == model.num_points3D() == summary.num_points
        assert summary.reconstruction is model
        assert summary.mean_track_length == 2.0
        for image_id in read.reg_image_ids():
            np.testing.assert_allclose(
                read.images[image_id].projection_center(),
                centre_of(orbit.cams_from_world[image_id - 1]),
                atol=POSITION_TOLERANCE,
            )


def test_a_point_has_the_mean_colour_of_the_keypoints_that_show_it(orbit, tmp_path):
    colors = colors_of(orbit, 2)
    # The second photo is darker: the mean is of two different colours.
    colors[2] = (colors[2] // 3).astype(np.uint8)
    export_models([make_model(orbit, 2)], colors, tmp_path / "sparse")
    read = pycolmap.Reconstruction(tmp_path / "sparse" / "0")
    assert read.num_points3D() > 30
    for point in read.points3D.values():
        seen = [colors[e.image_id][e.point2D_idx].astype(float) for e in point.track.elements]
        assert np.abs(point.color - np.mean(seen, axis=0)).max() <= 0.5


def test_the_point_cloud_has_the_models_points_and_colours(orbit, tmp_path):
    export_models([make_model(orbit, 2)], colors_of(orbit, 2), tmp_path / "sparse")
    read = pycolmap.Reconstruction(tmp_path / "sparse" / "0")
    cloud = pycolmap.Reconstruction()
    cloud.import_PLY(tmp_path / "sparse" / "0" / "points3D.ply")
    expected = {tuple(p.xyz.astype(np.float32)): tuple(p.color) for p in read.points3D.values()}
    found = {tuple(p.xyz.astype(np.float32)): tuple(p.color) for p in cloud.points3D.values()}
    assert found == expected


def test_text_is_added_when_asked_for(orbit, tmp_path):
    export_models([make_model(orbit, 2)], colors_of(orbit, 2), tmp_path / "sparse", text=True)
    assert {path.name for path in (tmp_path / "sparse" / "0").iterdir()} == BINARY | TEXT


def renamed(model: pycolmap.Reconstruction, name: str) -> pycolmap.Reconstruction:
    model.images[1].name = name
    return model


ODD = ("a b.jpg", " a.jpg", "a.jpg ", "a\tb.jpg", "a\nb.jpg", "a\vb.jpg", "a\fb.jpg", "a\rb.jpg")
KEPT = ("#a.jpg", "a,b.jpg", 'a"b.jpg', "süd/写真.jpg", "a\u00a0b.jpg", "a\u2028b.jpg", "\\xe4.jpg")


@pytest.mark.parametrize("name", [*ODD, *KEPT])
def test_the_names_said_to_be_lost_in_text_are_those_that_are(orbit, tmp_path, name):
    model = renamed(make_model(orbit, 2), name)
    model.write_text(tmp_path)
    read = pycolmap.Reconstruction()
    try:
        read.read_text(tmp_path)
        kept = read.images[1].name == name
    except (ValueError, IndexError):
        kept = False
    assert kept == (first_name_lost_in_text(["b.jpg", name]) is None) == (name in KEPT)


def test_a_model_whose_names_text_would_cut_has_no_text(orbit, tmp_path, caplog):
    models = [renamed(make_model(orbit, 3), "a b.jpg"), make_model(orbit, 2)]
    export_models(models, colors_of(orbit, 3), tmp_path / "sparse", text=True)
    written = [{path.name for path in (tmp_path / "sparse" / n).iterdir()} for n in "01"]
    assert written == [BINARY, BINARY | TEXT]
    assert pycolmap.Reconstruction(tmp_path / "sparse" / "0").images[1].name == "a b.jpg"
    (message,) = caplog.messages
    assert "'a b.jpg'" in message


def test_no_models_leave_an_empty_folder(tmp_path):
    assert export_models([], {}, tmp_path / "sparse") == []
    assert list((tmp_path / "sparse").iterdir()) == []


def test_new_models_take_the_place_of_the_old(orbit, tmp_path):
    colors = colors_of(orbit, 3)
    export_models([make_model(orbit, 3), make_model(orbit, 2)], colors, tmp_path / "sparse")
    export_models([make_model(orbit, 2)], colors, tmp_path / "sparse")
    assert [path.name for path in tmp_path.iterdir()] == ["sparse"]
    assert [path.name for path in (tmp_path / "sparse").iterdir()] == ["0"]
    assert pycolmap.Reconstruction(tmp_path / "sparse" / "0").num_reg_images() == 2


class Broken:
    """A model that cannot be written: the disk is full."""

    def __init__(self, model: pycolmap.Reconstruction, at: str) -> None:
        self._model = model
        self._at = at

    def __getattr__(self, name: str) -> object:
        if name == self._at:
            raise OSError("No space left on device")
        return getattr(self._model, name)


@pytest.mark.parametrize("at", ["point3D_ids", "write_binary", "export_PLY"])
def test_a_crash_leaves_the_models_that_were_there(orbit, tmp_path, at):
    colors = colors_of(orbit, 3)
    export_models([make_model(orbit, 2)], colors, tmp_path / "sparse")
    before = files_below(tmp_path / "sparse")
    with pytest.raises(StorageError, match="No space left"):
        export_models(
            [make_model(orbit, 3), Broken(make_model(orbit, 2), at)], colors, tmp_path / "sparse"
        )
    assert files_below(tmp_path / "sparse") == before
    # And what the crash left behind does not stand in the way.
    export_models([make_model(orbit, 3)], colors, tmp_path / "sparse")
    assert [path.name for path in tmp_path.iterdir()] == ["sparse"]
    assert pycolmap.Reconstruction(tmp_path / "sparse" / "0").num_reg_images() == 3


def test_a_crash_on_the_first_export_leaves_no_models(orbit, tmp_path):
    with pytest.raises(StorageError, match="No space left"):
        export_models(
            [Broken(make_model(orbit, 2), "export_PLY")], colors_of(orbit, 2), tmp_path / "sparse"
        )
    assert not (tmp_path / "sparse").exists()


@pytest.mark.parametrize("killed_after", ["writing", "the first move", "the second move"])
def test_what_a_kill_between_the_moves_leaves_is_completed(orbit, tmp_path, killed_after):
    sparse, fresh, old = (tmp_path / name for name in ("sparse", "sparse.new", "sparse.old"))
    export_models([make_model(orbit, 2)], colors_of(orbit, 2), sparse)
    export_models([make_model(orbit, 3)], colors_of(orbit, 3), tmp_path / "other")
    (tmp_path / "other").rename(fresh)
    if killed_after != "writing":
        sparse.rename(old)
    if killed_after == "the second move":
        fresh.rename(sparse)
    recover_models(sparse)
    expected = 2 if killed_after == "writing" else 3
    assert pycolmap.Reconstruction(sparse / "0").num_reg_images() == expected
    assert [path.name for path in tmp_path.iterdir()] == ["sparse"]


@pytest.mark.parametrize(
    ("writer", "file"),
    [
        ("write_binary", "images.bin"),
        ("write_binary", "points3D.bin"),
        ("export_PLY", "points3D.ply"),
        ("write_text", "points3D.txt"),
    ],
)
def test_models_cut_short_are_noticed(orbit, tmp_path, monkeypatch, writer, file):
    """pycolmap does not tell; where a quota is full, nor does the disk's free space."""
    write = getattr(pycolmap.Reconstruction, writer)

    def cut(model: pycolmap.Reconstruction, target: Path) -> None:
        write(model, target)
        written = target if target.name == file else target / file
        written.write_bytes(written.read_bytes()[:-100])

    monkeypatch.setattr(pycolmap.Reconstruction, writer, cut)
    with pytest.raises(StorageError, match="No space left"):
        export_models([make_model(orbit, 2)], colors_of(orbit, 2), tmp_path / "sparse", text=True)
    assert not (tmp_path / "sparse").exists()
