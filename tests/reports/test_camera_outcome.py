"""What is told of cameras: lens, drift against EXIF, and whether photos determine it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pycolmap
import pytest
from helpers.model_building import FOCAL, HEIGHT, WIDTH, looking, make_model

from sfm_front.reports.camera_outcome import (
    CameraOutcome,
    camera_outcomes,
    camera_rows,
    camera_warnings,
    cameras_from_rows,
)
from sfm_front.types import ModelSummary

POSE = looking([0, 0, 0], [0, 1, 0], [0, 0, 1])
DRIFTED = CameraOutcome(
    model_path="sparse/0",
    camera_id=1,
    num_photos=12,
    lens="SIMPLE_PINHOLE",
    params=(1100.0, 500.0, 400.0),
    focal_px=1100.0,
    prior_focal_px=1000.0,
    focal_sigma=0.01,
    is_determined=False,
)


def outcome(prior: bool, sigmas: dict[int, float]) -> CameraOutcome:
    first = pycolmap.Camera.create_from_model_name(1, "SIMPLE_RADIAL", 0.8 * FOCAL, WIDTH, HEIGHT)
    first.has_prior_focal_length = prior
    model = make_model({"a.jpg": POSE, "b.jpg": POSE})
    written = ModelSummary(Path("out/sparse/0"), model, 2, 0, 0.0, 0.0)
    (found,) = camera_outcomes(written, {1: first}, sigmas, max_focal_sigma=0.003)
    return found


def test_a_camera_is_described_as_it_ended():
    found = outcome(prior=True, sigmas={1: 0.002})
    assert (found.lens, found.num_photos, found.focal_px) == ("SIMPLE_PINHOLE", 2, FOCAL)
    assert found.params == (FOCAL, WIDTH / 2, HEIGHT / 2)
    assert found.drift == pytest.approx(0.25)
    assert found.is_determined is True
    assert outcome(prior=True, sigmas={1: 0.004}).is_determined is False
    unknown = outcome(prior=False, sigmas={})
    assert (unknown.prior_focal_px, unknown.drift, unknown.is_determined) == (None, None, None)


@pytest.mark.parametrize(
    ("determined", "end"),
    [
        (True, "; the photos determine it"),
        (False, ", and the photos do not determine it: the model may be bent"),
        (None, "; too few photos to tell which is right"),
    ],
)
def test_a_drift_is_warned_of(determined, end):
    (line,) = camera_warnings([replace(DRIFTED, is_determined=determined)], "sparse/0")
    assert line == (
        "camera 1 (12 photos): its focal length ended at 1100 px, 10% above the 1000 px of EXIF"
        + end
    )


def test_only_drifts_of_this_model_above_five_per_cent_are_told_the_most_photos_first():
    cameras = [
        replace(DRIFTED, camera_id=1, num_photos=3, focal_px=940.0),
        replace(DRIFTED, camera_id=2, focal_px=1049.0),
        replace(DRIFTED, camera_id=3, prior_focal_px=None),
        replace(DRIFTED, camera_id=4),
        replace(DRIFTED, camera_id=5, model_path="sparse/1"),
    ]
    lines = camera_warnings(cameras, "sparse/0")
    assert [line[:9] for line in lines] == ["camera 4 ", "camera 1 "]
    assert "6% below" in lines[1]


def test_rows_are_read_back():
    cameras = (DRIFTED, replace(DRIFTED, prior_focal_px=None, focal_sigma=None, is_determined=None))
    rows = json.loads(json.dumps(camera_rows(cameras)))
    assert rows[0]["focal_drift"] == pytest.approx(0.1)
    assert cameras_from_rows(rows) == cameras
