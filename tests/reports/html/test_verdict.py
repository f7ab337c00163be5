"""Lights and the sentence at the top."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pycolmap
import pytest
from helpers.report_making import METRIC, Output, summary_of

from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.residuals import ControlAccuracy
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.html.cameras import CameraResult, median_change
from sfm_front.reports.html.material import Material
from sfm_front.reports.html.verdict import Level, lights, sentence
from sfm_front.storage.finished_session import FinishedSession
from sfm_front.types import SkipReason


def material_of(*, num_matched: int = 500, **output) -> Material:
    summary = summary_of(Output(**output))
    models = [pycolmap.Reconstruction()] * len(summary.models)
    matched = {photo.image_id: num_matched for photo in summary.used}
    sidecar = output.get("sidecar")
    return Material(Path("out"), summary, models, FinishedSession(num_matched=matched), sidecar, {})


def camera(num_photos: int, focal_px: float, exif_px: float | None) -> CameraResult:
    return CameraResult(pycolmap.Camera(), num_photos, focal_px, exif_px)


def light(name: str, material: Material, cameras: list[CameraResult] | None = None):
    (found,) = [light for light in lights(material, cameras or []) if light.name == name]
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
    assert light("Focal length", material_of(), [camera(5, focal_px, 1000)]).level is level


def test_without_exif_nothing_is_said_of_the_focal_length():
    assert light("Focal length", material_of(), [camera(5, 900, None)]).level is Level.UNKNOWN


def test_cameras_weigh_by_their_photos():
    cameras = [camera(5, 1010, 1000), camera(4, 1500, 1000), camera(90, 1, None)]
    assert median_change(cameras) == pytest.approx(0.01)


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


@pytest.mark.parametrize(
    ("output", "said"),
    [
        ({"num_waiting": 0}, "All 9 photos are in one model."),
        ({"num_waiting": 0, "sidecar": METRIC}, "All 9 photos are in one model, in metres."),
        (
            {"num_waiting": 2, "why_not": "it is dark"},
            "7 of 9 photos are in one model; 2 in none, because: it is dark.",
        ),
        ({"has_model": False}, "No model could be built from 9 photos."),
        (
            {"num_waiting": 0, "is_doubtful": True, "skipped": {"a": SkipReason.EMPTY_FILE}},
            "All 9 photos are in one model, but some of their matches contradict it. "
            "1 file could not be used.",
        ),
    ],
)
def test_the_sentence_says_what_came_out_and_why_it_is_no_more(output, said):
    assert sentence(material_of(**output)) == said


def test_several_models_are_said():
    material = material_of(num_waiting=0)
    models = [replace(material.summary.models[0], num_registered=n) for n in (6, 3)]
    summary = replace(material.summary, models=tuple(models))
    said = sentence(replace(material, summary=summary))
    assert said == "6 of 9 photos are in one model; 3 more in 1 other."
