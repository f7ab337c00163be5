"""Sessions over photos taken through a lens that is not the simple one that cameras start with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import described

from sfm_front.evaluation.poses import pose_errors
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.photos.cameras import CameraOptions
from sfm_front.reports.report_json import read_report
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session

NUM_PHOTOS = 12
TANGENTIAL = (0.003, -0.004)


@pytest.fixture(scope="module")
def ring() -> SyntheticScene:
    """Photos through a lens that is off its axis."""
    scene = make_scene(NUM_PHOTOS, 500, seed=1, layout="ring", noise_px=0.3)
    lens = pycolmap.Camera(
        camera_id=1,
        model="OPENCV",
        width=scene.camera.width,
        height=scene.camera.height,
        params=[1300, 1300, 800, 600, -0.1, 0.02, *TANGENTIAL],
    )
    return replace(scene, camera=lens)


def options(**cameras: object) -> SessionOptions:
    return SessionOptions(
        global_descriptor="vlad", threads=1, cameras=CameraOptions(**cameras), snapshot_seconds=1e9
    )


def assert_grown(model: pycolmap.Reconstruction) -> None:
    assert model.num_reg_images() == NUM_PHOTOS
    (camera,) = model.cameras.values()
    assert camera.model_name == "OPENCV"
    np.testing.assert_allclose(camera.params[6:], TANGENTIAL, atol=1e-3)


def test_the_camera_grows_at_the_end_and_the_report_says_so(ring, tmp_path):
    medians = {}
    for model in ("auto", "SIMPLE_RADIAL"):
        with Session(tmp_path / model, options(model=model)) as session:
            for index in range(NUM_PHOTOS):
                session.add_extracted(described(ring, index))
            (finished,) = session.finish().models
        medians[model] = np.median(pose_errors(ring.truth(), [finished.reconstruction]))
        (camera,) = read_report(tmp_path / model).cameras
        (used,) = finished.reconstruction.cameras.values()
        assert (camera.lens, camera.params) == (used.model_name, tuple(used.params))
        assert (camera.num_photos, camera.is_determined) == (NUM_PHOTOS, True)
        if model == "auto":
            assert_grown(finished.reconstruction)
        else:
            assert used.model_name == "SIMPLE_RADIAL"
    assert medians["auto"] < 0.7 * medians["SIMPLE_RADIAL"]


def test_a_finished_session_goes_on_with_simple_lenses_and_ends_with_grown_ones(ring, tmp_path):
    with Session(tmp_path, options()) as session:
        for index in range(NUM_PHOTOS - 2):
            session.add_extracted(described(ring, index))
        (finished,) = session.finish().models
        assert finished.reconstruction.cameras[1].model_name == "OPENCV"
    with Session(tmp_path, options(), resume=True) as session:
        for index in range(NUM_PHOTOS - 2, NUM_PHOTOS):
            session.add_extracted(described(ring, index))
        (finished,) = session.finish().models
    assert_grown(finished.reconstruction)


@pytest.mark.parametrize(
    ("cameras", "may_grow"),
    [
        ({}, True),
        ({"model": "RADIAL"}, False),
        ({"params": (1300.0, 800.0, 600.0, 0.0)}, False),
    ],
)
def test_only_a_camera_nobody_named_or_knows_may_grow(cameras, may_grow):
    assert options(**cameras).atlas.mapper.calibration.grow_lens is may_grow
