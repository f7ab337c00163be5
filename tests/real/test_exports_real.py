"""Exports of real photos, read as other tools read them, smaller than by default to be quick."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest
from helpers.foreign_readers import (
    read_bundler_scene,
    read_nerfstudio_scene,
    read_nvm_scene,
    read_openmvs_scene,
    read_splat_scene,
)
from helpers.locations import DATA

from sfm_front.cli.main import main

FAST = ("--max-image-size", "800", "--max-features", "1500", "--global-descriptor", "vlad")
NUM_PHOTOS = 11
EXACT_PX = 1e-3

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DATA.is_dir(), reason="needs ../shared/data"),
]


@pytest.fixture(scope="module")
def fountain(tmp_path_factory):
    output = tmp_path_factory.mktemp("fountain") / "out"
    photos = DATA / "strecha_fountain_P11" / "images"
    assert main(["reconstruct", str(photos), "--output", str(output), *FAST]) == 0
    return output


@pytest.fixture(scope="module")
def model(fountain):
    return pycolmap.Reconstruction(fountain / "sparse" / "0")


def exported(fountain, target, *more):
    folder = fountain / "export" / target
    if not folder.exists():
        assert main(["export", str(fountain), "--to", target, *more]) == 0
    return folder


@pytest.mark.parametrize(
    ("target", "read"),
    [
        ("3dgs", lambda folder: read_splat_scene(folder, centred=True)),
        ("gsplat", lambda folder: read_splat_scene(folder, centred=False)),
        ("openmvs", read_openmvs_scene),
        ("bundler", read_bundler_scene),
        ("nvm", read_nvm_scene),
    ],
)
def test_points_project_where_keypoints_are(fountain, model, target, read):
    photos = read(exported(fountain, target))
    assert len(photos) == NUM_PHOTOS
    errors = np.concatenate([photo.errors_px() for photo in photos])
    mean = np.linalg.norm(errors, axis=1).mean()
    assert len(errors) == model.compute_num_observations()
    # Undistorted, a pixel in a corner is some thousandths larger or smaller.
    assert mean == pytest.approx(mean_over_observations_px(model), rel=0.02, abs=0.01)


def mean_over_observations_px(model):
    """COLMAP's mean is one over points, whatever the length of their tracks."""
    errors = [
        np.linalg.norm(image.project_point(model.points3D[seen.point3D_id].xyz) - seen.xy)
        for image in model.images.values()
        for seen in image.points2D
        if seen.has_point3D()
    ]
    return np.mean(errors)


def test_nerfstudios_projection_is_the_models(fountain, model):
    for photo in read_nerfstudio_scene(exported(fountain, "nerfstudio")):
        check_projection(model, photo.file.name, photo.project)


def check_projection(model, name, project):
    image = model.find_image_with_name(name)
    ids = [p.point3D_id for p in image.points2D if p.has_point3D()]
    points = np.array([model.point3D(i).xyz for i in ids])
    expected = model.camera(image.camera_id).img_from_cam(image.cam_from_world() * points)
    np.testing.assert_allclose(project(points), expected, rtol=0, atol=EXACT_PX)


def test_nerfstudios_own_parser_reads_the_export(fountain, model):
    """Poses, lenses and points of its parser, whose world it turned and scaled, agree."""
    parser = pytest.importorskip("nerfstudio.data.dataparsers.nerfstudio_dataparser")
    folder = exported(fountain, "nerfstudio")
    config = parser.NerfstudioDataParserConfig(data=folder, load_3D_points=True, eval_mode="all")
    read = config.setup().get_dataparser_outputs("train")
    cameras, points = read.cameras, read.metadata["points3D_xyz"].numpy()
    numbers = {point_id: n for n, point_id in enumerate(sorted(model.point3D_ids()))}
    assert len(points) == len(numbers)
    assert len(read.image_filenames) == NUM_PHOTOS
    for index, file in enumerate(read.image_filenames):
        image = model.find_image_with_name(file.name)
        ids = [p.point3D_id for p in image.points2D if p.has_point3D()]
        world_from_camera = np.eye(4)
        world_from_camera[:3] = cameras.camera_to_worlds[index].numpy()
        there = np.column_stack([points[[numbers[i] for i in ids]], np.ones(len(ids))])
        right, up, back, _ = np.linalg.solve(world_from_camera, there.T)
        flat = np.column_stack([right / -back, up / back])
        square = np.sum(flat**2, axis=1, keepdims=True)
        k1, k2 = cameras.distortion_params[index].numpy()[:2]
        focal = np.array([cameras.fx[index].item(), cameras.fy[index].item()])
        centre = np.array([cameras.cx[index].item(), cameras.cy[index].item()])
        pixels = focal * flat * (1 + k1 * square + k2 * square**2) + centre
        xyz = np.array([model.point3D(i).xyz for i in ids])
        expected = model.camera(image.camera_id).img_from_cam(image.cam_from_world() * xyz)
        # Its numbers are float32.
        np.testing.assert_allclose(pixels, expected, rtol=0, atol=5 * EXACT_PX)
