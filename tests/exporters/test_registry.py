"""Which model is exported, to where, with which photos, and what is said of it."""

from __future__ import annotations

import json
import sqlite3
from dataclasses import replace

import pytest
from helpers.export_scenes import PLAIN, exact_model, model_folder, write_photos

from sfm_front.errors import InputError
from sfm_front.exporters.options import ExportOptions
from sfm_front.exporters.registry import TARGETS, export
from sfm_front.exporters.scene import read_scene
from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.sidecar import FILE_NAME, Sidecar, write_sidecar
from sfm_front.georeference.spread import GeoreferenceState

ALL_BUT_MAPS = [target for target in TARGETS if target != "geojson"]
METRIC = Sidecar(
    state=GeoreferenceState.METRIC,
    origin=LocalFrame(45.0, -30.0, 200.0),
    models_in_enu=(0, 1),
)


@pytest.fixture
def output(tmp_path):
    """An output of two models, the larger of which is the second; its photos are beside it."""
    folder = tmp_path / "out"
    model_folder(folder, exact_model(names=PLAIN[:2]), 0)
    model_folder(folder, exact_model(), 1)
    for index, path in enumerate(write_photos(tmp_path / "taken").values()):
        (tmp_path / "photos").mkdir(exist_ok=True)
        path.rename(tmp_path / "photos" / PLAIN[index])
    return folder


@pytest.mark.parametrize("target", TARGETS)
def test_every_target_has_a_folder_with_a_readme_and_a_next_step(output, target):
    write_sidecar(output / "sparse" / FILE_NAME, METRIC)
    exported = export(output, target, images=output.parent / "photos")
    assert exported.folder == output / "export" / target
    assert (exported.num_photos, exported.notes) == (3, ())
    readme = (exported.folder / "README.txt").read_text()
    assert f"--to {target}" in readme
    assert "3 photos" in readme
    assert readme.splitlines()[-1].strip() == exported.next_step.format(folder=".")
    assert str(output) not in readme


@pytest.mark.parametrize("target", ["ply", "csv", "colmap-text"])
def test_what_needs_no_photos_does_without(output, target):
    assert export(output, target).num_photos == 3


def test_nothing_is_written_over_and_nothing_is_read_before_that_is_known(output):
    first = export(output, "ply")
    before = (first.folder / "points3D.ply").stat().st_mtime_ns
    with pytest.raises(InputError, match="is there already"):
        export(output, "ply")
    with pytest.raises(InputError, match="is there already"):
        export(output.parent / "nowhere", "ply", output=first.folder)
    assert (first.folder / "points3D.ply").stat().st_mtime_ns == before


def test_a_model_is_picked_by_its_number_or_its_folder(output, tmp_path):
    assert export(output, "csv", number=0, output=tmp_path / "a").num_photos == 2
    assert export(output / "sparse", "csv", number=0, output=tmp_path / "b").num_photos == 2
    one = export(output / "sparse" / "0", "csv")
    assert (one.num_photos, one.folder) == (2, output.absolute() / "export" / "csv")


def test_a_model_of_nobody_is_exported_beside_itself(tmp_path):
    exact_model().write_text(tmp_path)
    assert export(tmp_path, "ply").folder == tmp_path / "export" / "ply"


@pytest.mark.parametrize(
    ("place", "number", "message"),
    [
        (".", 7, "has no model 7; there are: 0, 1"),
        ("sparse/1", 1, "is one model already; leave --model out"),
        ("nowhere", None, "no such folder"),
        ("../photos", None, "no COLMAP model in it"),
    ],
)
def test_a_model_that_is_not_there_is_told(output, place, number, message):
    with pytest.raises(InputError, match=message):
        export(output / place, "ply", number=number, output=output / "x")
    assert not (output / "x").exists()


def test_a_model_without_photos_is_told(tmp_path):
    model = exact_model()
    for frame in model.reg_frame_ids():
        model.deregister_frame(frame)
    model_folder(tmp_path, model)
    with pytest.raises(InputError, match="the model has no photo in it"):
        export(tmp_path, "ply")


def test_a_model_that_was_cut_short_is_not_read(output):
    images = output / "sparse" / "1" / "images.bin"
    sizes = {"1/images.bin": images.stat().st_size}
    (output / "sparse" / "session.json").write_text(json.dumps({"files": sizes}))
    images.write_bytes(images.read_bytes()[:-100])
    with pytest.raises(InputError, match=r"images\.bin: not whole"):
        export(output, "ply")


def test_photos_that_nobody_knows_are_asked_for(output):
    with pytest.raises(InputError, match=r"'a\.png' and all other photos .* --images"):
        export(output, "3dgs")
    assert not (output / "export" / "3dgs").exists()
    with pytest.raises(InputError, match="no such folder"):
        export(output, "3dgs", images=output / "nowhere")


def test_no_name_leads_out_of_the_folder_of_photos(tmp_path):
    photos = write_photos(tmp_path / "photos", ("a.png", "secret.png"))
    photos["a.png"].rename(tmp_path / "photos" / "a.png")
    photos["secret.png"].rename(tmp_path / "secret.png")
    model_folder(tmp_path / "evil", exact_model(names=("../secret.png", "a.png")))
    exported = export(tmp_path / "evil", "nerfstudio", images=tmp_path / "photos")
    assert exported.num_photos == 1
    assert exported.notes == ("1 left out: '../secret.png' (not found)",)


def test_a_foreign_database_is_left_as_it_is(output):
    database = output / "database.db"
    with sqlite3.connect(database) as connection:
        connection.execute("CREATE TABLE images (image_id INTEGER, name TEXT)")
    before = database.read_bytes()
    export(output, "csv")
    assert database.read_bytes() == before
    assert not list(output.glob("database.db-*"))


def test_the_frame_is_that_of_models_in_it_alone(output):
    file = output / "sparse" / FILE_NAME
    assert read_scene(output).frame is None
    write_sidecar(file, replace(METRIC, models_in_enu=(0,)))
    assert read_scene(output).frame is None
    assert read_scene(output, number=0).frame == METRIC.origin
    write_sidecar(file, METRIC)
    assert read_scene(output).frame == METRIC.origin
    file.write_text('{"state": "metric"}')
    with pytest.raises(InputError, match=r"georeference\.json: not a georeference\.json"):
        read_scene(output)


def test_an_upright_world_stays_upright_in_nerfstudio(output):
    write_sidecar(output / "sparse" / FILE_NAME, METRIC)
    exported = export(output, "nerfstudio", images=output.parent / "photos")
    content = json.loads((exported.folder / "transforms.json").read_text())
    assert content["orientation_override"] == "none"


def test_a_target_that_is_not_known_is_told(output):
    with pytest.raises(InputError, match="no target is called 'obj'; there are: colmap-text, ply"):
        export(output, "obj")


def test_an_export_that_fails_leaves_nothing(output):
    def stop(_done, _total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export(output, "3dgs", images=output.parent / "photos", on_progress=stop)
    assert list((output / "export").iterdir()) == []


def test_links_and_sizes_reach_the_photos(output):
    photos = output.parent / "photos"
    linked = export(output, "nerfstudio", images=photos, options=ExportOptions(link=True))
    assert (linked.folder / "images" / "a.png").resolve() == (photos / "a.png").resolve()
    small = ExportOptions(max_size_px=64, link=True)
    reduced = export(output, "nerfstudio", images=photos, options=small, output=output / "small")
    content = json.loads((reduced.folder / "transforms.json").read_text())
    assert (content["w"], content["h"]) == (64, 48)
