"""What a report sums up, and report.json, written and read back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.georeference_making import FLIGHT
from helpers.model_building import looking, make_model

from sfm_front.errors import InputError
from sfm_front.events import (
    Evidence,
    LookAlikesRefused,
    ModelRefined,
    ModelStarted,
    PhotoAdded,
    StartKind,
)
from sfm_front.mapping.audit import ModelAudit
from sfm_front.reports.report_json import read_report, write_report
from sfm_front.reports.run_report import RunReport
from sfm_front.reports.run_summary import GeoreferenceOutcome, Latency, RunSummary
from sfm_front.types import (
    CandidateOutcome,
    ModelSummary,
    Rejected,
    Rejection,
    Skipped,
    SkipReason,
    Waiting,
    WaitingReason,
)

POSE = looking([0, 0, 0], [0, 1, 0], [0, 0, 1])


def summary(output: Path, number: int, names: list[str], *, error_px: float, points: int):
    return ModelSummary(
        path=output / "sparse" / str(number),
        reconstruction=make_model(dict.fromkeys(names, POSE)),
        num_registered=len(names),
        num_points=points,
        mean_reprojection_error_px=error_px,
        mean_track_length=3.25,
    )


STARTED = ModelStarted(1, (1, 2), 16.0, 100, StartKind.STREAM)
REFINED = ModelRefined(1, 2, 50, seconds=0.5)
REFUSED = LookAlikesRefused(1, ((1, 2), (3,)), Evidence.SURROUNDINGS, 40)
BROKEN = Skipped("broken.jpg", SkipReason.TRUNCATED, "half a JPEG")
PHOTOS = [
    PhotoAdded("ä 1.jpg", image_id=1, num_keypoints=90, seconds={"sift": 0.25}),
    BROKEN,
    PhotoAdded(
        "b.jpg",
        image_id=2,
        num_keypoints=80,
        candidates=(CandidateOutcome("ä 1.jpg", 0.123456, 40, True, None),),
        registered=("ä 1.jpg", "b.jpg"),
        num_registered=2,
        num_points=50,
        seconds={"sift": 0.5, "map": 0.125},
        events=(STARTED, REFINED),
    ),
    PhotoAdded(
        "c.jpg",
        image_id=3,
        candidates=(
            CandidateOutcome("b.jpg", 0.9, 12, False, None),
            CandidateOutcome(
                "ä 1.jpg", 0.95, 3, False, Rejected(Rejection.NO_EPIPOLAR_GEOMETRY, 31, 9)
            ),
        ),
        num_registered=2,
        num_points=50,
    ),
]


@pytest.fixture
def run(tmp_path) -> RunSummary:
    report = RunReport()
    for photo in PHOTOS:
        report.add(photo)
    models = [
        summary(tmp_path, 0, ["ä 1.jpg", "b.jpg"], error_px=0.5, points=300),
        summary(tmp_path, 1, ["ä 1.jpg"], error_px=1.5, points=100),
    ]
    why_not = {3: Waiting(WaitingReason.NO_POSE, 7)}
    return report.finish(
        models,
        why_not,
        {3: "take one between them"},
        audits=[
            ModelAudit(8, 2, 0.0625, ((1,), (2,)), 0.5),
            ModelAudit(0, 0, 0.0, None, 0.0),
        ],
        seconds={"export": 0.75},
        events=[REFINED, STARTED, REFUSED],
        latencies_s=[2.0, 0.12345678],
    )


@pytest.fixture
def content(run, tmp_path) -> dict:
    write_report(tmp_path, run)
    return json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))


def test_a_row_a_photo_in_their_order(content):
    first, broken, second, third = content["photos"]
    assert [row["name"] for row in (first, broken, second, third)] == [p.name for p in PHOTOS]
    assert broken == {
        "name": "broken.jpg",
        "image_id": None,
        "skipped": {"reason": "truncated", "detail": "half a JPEG"},
        "registered": False,
        "model": None,
    }
    # In two models: the largest counts.
    assert (first["registered"], first["model"], first["skipped"]) == (True, 0, None)
    assert second["placed_by_this_step"] == ["ä 1.jpg", "b.jpg"]
    assert second["most_relevant"] == "ä 1.jpg"
    assert (second["verified_pairs"], second["rejected_pairs"]) == (1, 0)
    assert second["keypoints"] == 80
    assert second["seconds"] == {"sift": 0.5, "map": 0.125}
    assert second["events"] == [str(STARTED)]  # the seconds tell of refinements
    assert (third["registered"], third["model"]) == (False, None)
    assert (third["verified_pairs"], third["rejected_pairs"]) == (0, 1)
    assert third["why_not_registered"] == "no pose fits the 7 model points it sees"
    assert third["waiting"] == "no pose fits the model points it sees"
    assert third["what_would_help"] == "take one between them"
    assert first["why_not_registered"] is None


def test_look_alikes_are_told_by_name(run, content, tmp_path):
    assert content["look_alikes"] == [[["ä 1.jpg", "b.jpg"], ["c.jpg"]]]
    assert read_report(tmp_path).look_alikes == run.look_alikes


def test_models_and_the_end(content):
    assert content["version"] == 1
    assert content["models"] == [
        {
            "path": "sparse/0",
            "registered": 2,
            "points3D": 300,
            "mean_reprojection_error_px": 0.5,
            "mean_track_length": 3.25,
            "audit": {
                "pairs": 8,
                "contradicted": 2,
                "contradicted_share": 0.0625,
                "doubtful": True,
                "worst_groups": [["ä 1.jpg"], ["b.jpg"]],
                "worst_share": 0.5,
            },
        },
        {
            "path": "sparse/1",
            "registered": 1,
            "points3D": 100,
            "mean_reprojection_error_px": 1.5,
            "mean_track_length": 3.25,
            "audit": {
                "pairs": 0,
                "contradicted": 0,
                "contradicted_share": 0,
                "doubtful": False,
                "worst_groups": [],
                "worst_share": 0,
            },
        },
    ]
    assert content["end"] == {"seconds": {"export": 0.75}, "events": [str(STARTED), str(REFUSED)]}


def test_totals(content):
    totals = content["totals"]
    assert totals.pop("wall_seconds") >= 0
    assert totals.pop("peak_memory_bytes") > 10 * 2**20
    assert totals == {
        "photos": 4,
        "used": 3,
        "skipped": 1,
        "registered": 2,
        "models": 2,
        "points3D": 400,
        "mean_reprojection_error_px": 0.75,  # of all points: (300 * 0.5 + 100 * 1.5) / 400
        "seconds_by_stage": {"export": 0.75, "sift": 0.75, "map": 0.125},
        "median_seconds_by_quarter": [0, 0.125, 0],
        "latency_seconds": {"median": 1.0617, "p95": 2.0, "worst": 2.0},
    }


@pytest.mark.usefixtures("content")
def test_what_is_read_back_is_what_was_written(run, tmp_path):
    read = read_report(tmp_path)
    assert read.photos == run.photos
    assert read.models == run.models
    assert (read.end_seconds, read.end_events) == (run.end_seconds, run.end_events)
    assert read.totals.wall_seconds == pytest.approx(run.totals.wall_seconds, abs=1e-3)
    assert read.totals.median_seconds_by_quarter == run.totals.median_seconds_by_quarter
    assert [photo.name for photo in read.used] == ["ä 1.jpg", "b.jpg", "c.jpg"]
    assert read.skipped == [BROKEN]


def test_a_report_of_an_earlier_version_has_no_audits(content, tmp_path):
    for model in content["models"]:
        del model["audit"]
    (tmp_path / "report.json").write_text(json.dumps(content), encoding="utf-8")
    assert [model.audit for model in read_report(tmp_path).models] == [None, None]


def test_what_positions_say_is_read_back_and_earlier_versions_have_nothing(run, tmp_path):
    told = replace(run, georeference=FLIGHT)
    write_report(tmp_path, told)
    read = read_report(tmp_path).georeference
    built = [one.sidecar.enu_from_built.matrix() for one in (read, FLIGHT)]
    np.testing.assert_allclose(*built)
    same = FLIGHT.sidecar.enu_from_built
    assert replace(read, sidecar=replace(read.sidecar, enu_from_built=same)) == FLIGHT
    nothing = GeoreferenceOutcome(sidecar=None, num_unused_rows=3)
    write_report(tmp_path, replace(run, georeference=nothing))
    assert read_report(tmp_path).georeference == nothing
    content = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    del content["georeference"]
    (tmp_path / "report.json").write_text(json.dumps(content), encoding="utf-8")
    assert read_report(tmp_path).georeference is None


@pytest.mark.parametrize("text", [None, "", "[]", '{"photos": 3}', '{"photos": [{}]}'])
def test_an_unreadable_report_is_refused_in_one_line(tmp_path, text):
    if text is not None:
        (tmp_path / "report.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"no readable report\.json") as refused:
        read_report(tmp_path)
    assert "\n" not in str(refused.value)


def test_work_by_quarter_is_what_a_photo_waits_for_in_its_turn():
    report = RunReport()
    for number in range(1, 9):
        seconds = {"match": float(number), "refine": 100.0, "sift": 10.0, "read": 1.0}
        report.add(PhotoAdded(f"{number}.jpg", image_id=number, seconds=seconds))
    run = report.finish([], {}, {}, audits=[], seconds={}, events=(), latencies_s=())
    assert run.totals.median_seconds_by_quarter == (1.5, 3.5, 5.5, 7.5)


def test_without_models_there_is_still_a_report():
    report = RunReport()
    report.add(BROKEN)
    run = report.finish([], {}, {}, audits=[], seconds={}, events=[], latencies_s=[])
    assert run.models == ()
    assert run.totals.num_registered == 0
    assert run.totals.mean_reprojection_error_px is None
    assert run.totals.latency is None


def test_a_photo_that_was_skipped_and_comes_again_counts_once():
    report = RunReport()
    whole = PhotoAdded("a.jpg", image_id=1)
    copy = Skipped("a.jpg", SkipReason.DUPLICATE, "same file as a.jpg")
    for photo in (Skipped("a.jpg", SkipReason.TRUNCATED), BROKEN, BROKEN, whole):
        report.add(photo)
    run = report.finish([], {}, {}, audits=[], seconds={}, events=[], latencies_s=[])
    assert [photo.name for photo in run.photos] == ["broken.jpg", "a.jpg"]
    assert run.skipped == [BROKEN]
    # A copy under the same name does not take the place of the photo itself.
    report.add(copy)
    run = report.finish([], {}, {}, audits=[], seconds={}, events=[], latencies_s=[])
    assert run.skipped == [BROKEN, copy]
    assert len(run.used) == 1


def test_of_latencies_95_percent_are_no_longer_than_said():
    assert Latency.of([]) is None
    assert Latency.of([0.5]) == Latency(0.5, 0.5, 0.5)
    assert Latency.of([float(n) for n in range(100, 0, -1)]) == Latency(50.5, 95.0, 100.0)
    assert Latency.of([1.0] * 19 + [9.0]) == Latency(1.0, 1.0, 9.0)


@pytest.mark.usefixtures("content")
def test_latency_is_read_back_and_earlier_versions_have_none(tmp_path):
    read = read_report(tmp_path).totals.latency
    assert read == Latency(1.0617, 2.0, 2.0)
    file = tmp_path / "report.json"
    content = json.loads(file.read_text(encoding="utf-8"))
    del content["totals"]["latency_seconds"]
    file.write_text(json.dumps(content), encoding="utf-8")
    assert read_report(tmp_path).totals.latency is None
