"""The lights beside the verdict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pycolmap
import pytest
from helpers.report_making import METRIC, Output, summary_of

from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.residuals import ControlAccuracy
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.camera_outcome import CameraOutcome
from sfm_front.reports.html.material import Material
from sfm_front.reports.html.verdict import all_lights
from sfm_front.reports.lights import Level, focal_length
from sfm_front.storage.stored_session import StoredSession


def material_of(*, num_matched: int = 500, **output) -> Material:
    summary = summary_of(Output(**output))
    models = [pycolmap.Reconstruction()] * len(summary.models)
    matched = {photo.image_id: num_matched for photo in summary.used}
    sidecar = output.get("sidecar")
    return Material(Path("out"), summary, models, StoredSession(num_matched=matched), sidecar, {})


def camera(
    num_photos: int, focal_px: float, exif_px: float | None, is_determined: bool | None = None
) -> CameraOutcome:
    return CameraOutcome(
        model_path="sparse/0",
        camera_id=1,
        num_photos=num_photos,
        lens="SIMPLE_PINHOLE",
        params=(focal_px, 500.0, 400.0),
        focal_px=focal_px,
        prior_focal_px=exif_px,
        focal_sigma=None,
        is_determined=is_determined,
    )


def light(name: str, material: Material):
    (found,) = [light for light in all_lights(material) if light.name == name]
    return found


@pytest.mark.parametrize(
    ("num_waiting", "level"),
    [(0, Level.GOOD), (4, Level.GOOD), (5, Level.FAIR), (35, Level.FAIR), (36, Level.BAD)],
)
def test_registered_photos(num_waiting, level):
    found = light("Photos in the model", material_of(num_photos=100, num_waiting=num_waiting))
    assert found.level is level
    assert found.value == f"{100 - num_waiting}%"


def test_no_model_is_no_photo_in_it():
    assert light("Photos in the model", material_of(has_model=False)).level is Level.BAD


@pytest.mark.parametrize(
    ("matches", "level"),
    [(1001, Level.GOOD), (1000, Level.FAIR), (100, Level.FAIR), (99, Level.BAD)],
)
def test_matches(matches, level):
    assert light("Matches a photo", material_of(num_matched=matches)).level is level


@pytest.mark.parametrize(
    ("focal_px", "level"),
    [
        (1009, Level.GOOD),
        (991, Level.GOOD),
        (1011, Level.FAIR),
        (951, Level.FAIR),
        (1051, Level.BAD),
    ],
)
def test_focal_length(focal_px, level):
    material = material_of()
    summary = replace(material.summary, cameras=(camera(5, focal_px, 1000),))
    assert light("Focal length", replace(material, summary=summary)).level is level


def test_without_exif_nothing_is_said_of_the_focal_length():
    assert focal_length([camera(5, 900, None)]).level is Level.UNKNOWN


def test_where_the_photos_determine_it_exif_is_wrong():
    found = focal_length([camera(5, 1200, 1000, is_determined=True)])
    assert (found.level, found.doubt) == (Level.FAIR, "")
    for unknown in (False, None):
        found = focal_length([camera(5, 1200, 1000, is_determined=unknown)])
        assert (found.level, found.doubt) == (
            Level.BAD,
            "its focal length is 20% from what EXIF says and not determined by the photos",
        )


def test_cameras_weigh_by_their_photos():
    cameras = [camera(5, 1010, 1000), camera(4, 1500, 1000), camera(90, 1, None)]
    assert focal_length(cameras).value == "1.0 %"


def test_a_smaller_model_has_no_say_in_the_focal_length():
    material = material_of()
    other = replace(camera(9, 1500, 1000), model_path="sparse/1")
    summary = replace(material.summary, cameras=(camera(5, 1000, 1000), other))
    assert light("Focal length", replace(material, summary=summary)).level is Level.GOOD


def test_fit_to_positions():
    sound = replace(METRIC, residuals=replace(METRIC.residuals, outliers=()))
    assert light("Fit to GPS", material_of(sidecar=sound)).level is Level.GOOD
    assert light("Fit to GPS", material_of(sidecar=METRIC)).level is Level.FAIR
    doubted = replace(sound, reasons=("model and positions differ",))
    assert light("Fit to GPS", material_of(sidecar=doubted)).level is Level.FAIR
    provisional = replace(doubted, state=GeoreferenceState.PROVISIONAL)
    found = light("Fit to GPS", material_of(sidecar=provisional))
    assert (found.level, found.words) == (Level.FAIR, "model and positions differ")
    none = replace(METRIC, state=GeoreferenceState.NONE, residuals=None, reasons=("2 positions",))
    assert light("Fit to GPS", material_of(sidecar=none)).level is Level.BAD


def test_fit_to_control_points():
    held = ControlAccuracy(5, 0.01, 0.01, 0.02, 0.03, 0.04)
    checked = ControlAccuracy(2, 0.1, 0.1, 0.2, 0.3, 0.4)
    report = ControlReport(file="gcp_list.txt", model=0, control=held, checkpoints=checked)

    def found(report):
        return light("Control points", material_of(sidecar=replace(METRIC, control_points=report)))

    assert found(report).level is Level.GOOD
    assert (found(report).value, "2 checkpoints" in found(report).words) == ("0.300 m", True)
    unchecked = replace(report, checkpoints=replace(checked, count=0))
    assert (found(unchecked).value, "5 control" in found(unchecked).words) == ("0.030 m", True)
    assert found(replace(report, sigma_factor=3.0)).level is Level.FAIR
    assert found(ControlReport(file="f", not_used="line 7")).level is Level.BAD


def test_doubtful_models_are_bad():
    assert light("Consistency", material_of(is_doubtful=True)).level is Level.BAD
    assert light("Consistency", material_of()).level is Level.GOOD
