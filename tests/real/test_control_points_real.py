"""Ten points by handheld GPS, to a metre or so and without heights, one of them mismarked."""

from __future__ import annotations

import re

import numpy as np
import pytest
from helpers.locations import DATA

from sfm_front.cli.main import main
from sfm_front.georeference.control.residuals import PointRole
from sfm_front.georeference.sidecar import FILE_NAME, read_sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.storage.colmap_models import read_model

SCENE = DATA / "uav_copr"
# Of the photos in which the marks were made.
MARKED_SIZE = "4272,2848"
# Its mark in this photo is that of gcp00.
MISMARKED = ("gcp04", "IMG_0031.jpg")
# A similarity in the plane of the points leaves 1.7 m (root mean square), 0.2 to 1.7 m without
# the one point that is 3.8 m off.
MAX_MEDIAN_M = 1.5
MAX_WORST_M = 5.0
# Of the mean direction in which the photos were taken: nearly straight down.
MAX_DOWN = -0.95
MAX_RISE = 1.03

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not SCENE.is_dir(), reason="needs ../shared/data"),
]


def test_points_without_heights_hold_a_model_horizontally(tmp_path, capsys):
    pytest.importorskip("pyproj")
    out = tmp_path / "out"
    given = ("--gcp", str(SCENE / "gcp_list.txt"), "--gcp-size", MARKED_SIZE)
    assert main(["reconstruct", str(SCENE / "images"), "--output", str(out), *given]) == 0
    sidecar = read_sidecar(out / "sparse" / FILE_NAME)
    assert sidecar.state is GeoreferenceState.METRIC
    assert sidecar.models_in_enu == (0,)
    control = sidecar.control_points
    off = [p.horizontal_m for p in control.points if p.horizontal_m is not None]
    assert len(off) >= 9
    assert np.median(off) < MAX_MEDIAN_M
    assert max(off) < MAX_WORST_M
    assert control.sigma_factor > 10  # Stated were 2 cm.
    assert [(point.name, mark.photo) for point, mark in control.wrong_marks] == [MISMARKED]
    assert all(point.role is not PointRole.CHECKPOINT for point in control.points)
    assert control.error_after_px < MAX_RISE * control.error_before_px
    model = read_model(out / "sparse" / "0")
    images = [model.image(image_id) for image_id in model.reg_image_ids()]
    assert np.mean([image.viewing_direction()[2] for image in images]) < MAX_DOWN
    told = capsys.readouterr().out
    assert re.search(r"control points of gcp_list.txt: \d+ of 10 hold sparse/0: RMS east", told)
    assert "times less exact than stated" in told
    assert f"{MISMARKED[0]}: its mark in {MISMARKED[1]} is off by" in told
