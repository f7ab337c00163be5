"""What other tools read of an export: poses, lenses, points and photos, by their own documents."""

from __future__ import annotations

import json

import numpy as np
import pycolmap
import pytest
from helpers.export_scenes import LENSES, PLAIN, exact_model, job_of, write_photos
from helpers.foreign_readers import (
    read_bundler_scene,
    read_nerfstudio_scene,
    read_nvm_scene,
    read_openmvs_scene,
    read_splat_scene,
)
from PIL import Image

from sfm_front.errors import InputError
from sfm_front.exporters import (
    bundler,
    colmap_text,
    gaussian_splatting,
    gsplat,
    nerfstudio,
    nvm,
    openmvs,
    ply,
)
from sfm_front.exporters.nvm import undistorting_term

EXACT_PX = 1e-4
# Of one radial term that stands for the inverse of another.
RADIAL_PX = 0.5
FLOAT32 = 1e-6

SPLATS = {
    "3dgs": (gaussian_splatting, lambda folder: read_splat_scene(folder, centred=True)),
    "gsplat": (gsplat, lambda folder: read_splat_scene(folder, centred=False)),
    "openmvs": (openmvs, read_openmvs_scene),
}
RADIAL = ["SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"]


@pytest.fixture
def photos(tmp_path):
    return write_photos(tmp_path / "photos")


def check(photos, count=3, tolerance_px=EXACT_PX):
    assert len(photos) == count
    for photo in photos:
        assert len(photo.seen) > 10
        assert np.abs(photo.errors_px()).max() < tolerance_px
        size = Image.open(photo.file).size
        assert photo.size in (None, size)


@pytest.mark.parametrize("target", SPLATS)
@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("max_size", [None, 100])
def test_splats_and_openmvs(tmp_path, photos, target, lens, max_size):
    module, read = SPLATS[target]
    job = job_of(tmp_path, exact_model([lens]), photos, max_size_px=max_size)
    assert module.write(job) == []
    check(read(job.folder))
    assert sorted(p.name for p in (job.folder / "images").iterdir()) == list(PLAIN)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("max_size", [None, 100])
def test_nerfstudio(tmp_path, photos, lens, max_size):
    job = job_of(tmp_path, exact_model([lens]), photos, max_size_px=max_size)
    assert nerfstudio.write(job) == []
    read = read_nerfstudio_scene(job.folder)
    for photo, image_id in zip(read, sorted(job.scene.model.reg_image_ids()), strict=True):
        photo.seen = seen_in(job.scene.model, image_id)
    check(read)


def seen_in(model, image_id):
    points = (p for p in model.image(image_id).points2D if p.has_point3D())
    return [(model.point3D(p.point3D_id).xyz, p.xy) for p in points]


@pytest.mark.parametrize("lens", RADIAL)
@pytest.mark.parametrize("max_size", [None, 100])
def test_bundler(tmp_path, photos, lens, max_size):
    job = job_of(tmp_path, exact_model([lens]), photos, max_size_px=max_size)
    assert bundler.write(job) == []
    check(read_bundler_scene(job.folder))


@pytest.mark.parametrize("lens", RADIAL)
def test_nvm(tmp_path, photos, lens):
    job = job_of(tmp_path, exact_model([lens]), photos)
    assert nvm.write(job) == []
    check(read_nvm_scene(job.folder), tolerance_px=RADIAL_PX)


@pytest.mark.parametrize(
    ("module", "names"), [(bundler, "Bundler"), (nvm, "NVM")], ids=["bundler", "nvm"]
)
def test_what_a_list_of_keypoints_cannot_hold_is_refused(tmp_path, photos, module, names):
    with pytest.raises(InputError, match=f"{names} holds SIMPLE_RADIAL and RADIAL cameras only"):
        module.write(job_of(tmp_path, exact_model(["OPENCV"]), photos))
    off = exact_model(["SIMPLE_RADIAL"])
    off.cameras[1].params = [180, 103, 75, -0.1]
    (tmp_path / "off").mkdir()
    with pytest.raises(InputError, match=r"which is 3\.0 px off; export --to nerfstudio"):
        module.write(job_of(tmp_path / "off", off, photos))


def test_a_lens_that_one_term_cannot_undo_is_told(tmp_path, photos):
    model = exact_model(["RADIAL"])
    model.cameras[1].params = [90, 100, 75, -0.15, 0.02]
    (note,) = nvm.write(job_of(tmp_path, model, photos))
    assert "px off in the corners" in note


def test_the_radial_term_is_minus_k1_where_distortion_is_slight():
    for k1 in (-0.01, 0.01):
        slight = pycolmap.Camera(
            model="SIMPLE_RADIAL", width=200, height=150, params=[180, 100, 75, k1]
        )
        term, error_px = undistorting_term(slight)
        assert term == pytest.approx(-k1, rel=0.03)
        assert error_px < 0.01


def test_several_lenses_in_one_model(tmp_path, photos):
    lenses = ["SIMPLE_RADIAL", "OPENCV", "SIMPLE_PINHOLE"]
    job = job_of(tmp_path, exact_model(lenses), photos)
    nerfstudio.write(job)
    content = json.loads((job.folder / "transforms.json").read_text())
    assert content["camera_model"] == "OPENCV"
    assert "fl_x" not in content
    assert {frame["k1"] for frame in content["frames"]} == {-0.1, 0.0}
    read = read_nerfstudio_scene(job.folder)
    for photo, image_id in zip(read, sorted(job.scene.model.reg_image_ids()), strict=True):
        photo.seen = seen_in(job.scene.model, image_id)
    check(read)


def test_lenses_of_two_families_are_undistorted_for_nerfstudio(tmp_path, photos):
    job = job_of(tmp_path, exact_model(["OPENCV_FISHEYE", "OPENCV"]), photos)
    nerfstudio.write(job)
    content = json.loads((job.folder / "transforms.json").read_text())
    assert content["camera_model"] == "PINHOLE"
    assert not any("k1" in frame for frame in content["frames"])


def test_nerfstudio_is_told_which_world_it_is(tmp_path, photos):
    job = job_of(tmp_path, exact_model(), photos)
    nerfstudio.write(job)
    content = json.loads((job.folder / "transforms.json").read_text())
    assert content["applied_transform"] == np.eye(4)[:3].tolist()
    assert "orientation_override" not in content
    cloud = pycolmap.Reconstruction()
    cloud.import_PLY(job.folder / content["ply_file_path"])
    expected = [job.scene.model.point3D(i).xyz for i in sorted(job.scene.model.point3D_ids())]
    found = [cloud.point3D(i).xyz for i in sorted(cloud.point3D_ids())]
    np.testing.assert_allclose(found, expected, rtol=FLOAT32)


@pytest.mark.parametrize("normals", [False, True])
def test_plyfile_reads_the_points(tmp_path, normals):
    plyfile = pytest.importorskip("plyfile")
    model = exact_model()
    ply.write_point_cloud(model, tmp_path / "points.ply", normals=normals)
    points = [model.point3D(i) for i in sorted(model.point3D_ids())]
    read = plyfile.PlyData.read(str(tmp_path / "points.ply"))["vertex"]
    names = ["x", "y", "z", *(["nx", "ny", "nz"] if normals else []), "red", "green", "blue"]
    assert [column.name for column in read.properties] == names
    xyz = np.column_stack([read[name] for name in "xyz"])
    np.testing.assert_allclose(xyz, [point.xyz for point in points], rtol=FLOAT32)
    colors = np.column_stack([read[name] for name in ("red", "green", "blue")])
    np.testing.assert_array_equal(colors, [point.color for point in points])


def test_a_model_without_points_is_no_trouble(tmp_path, photos):
    for module in (gaussian_splatting, nerfstudio, bundler, nvm, ply, colmap_text):
        model = exact_model()
        for point in list(model.point3D_ids()):
            model.delete_point3D(point)
        (tmp_path / module.__name__).mkdir()
        module.write(job_of(tmp_path / module.__name__, model, photos))


def test_colmap_reads_its_text(tmp_path):
    model = exact_model(["OPENCV"])
    job = job_of(tmp_path, model, {})
    colmap_text.write(job)
    read = pycolmap.Reconstruction()
    read.read_text(job.folder)
    assert read.num_points3D() == model.num_points3D()
    for image_id, image in model.images.items():
        assert read.image(image_id).name == image.name
        np.testing.assert_array_equal(
            read.image(image_id).cam_from_world().matrix(), image.cam_from_world().matrix()
        )
    np.testing.assert_array_equal(read.camera(1).params, model.camera(1).params)


def test_a_name_that_text_would_cut_is_refused(tmp_path):
    model = exact_model(names=("a b.png", "c.png"))
    with pytest.raises(InputError, match=r"'a b\.png': COLMAP's text form cuts a name"):
        colmap_text.write(job_of(tmp_path, model, {}))
