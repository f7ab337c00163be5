"""retrieval.jsonl and report.json: what stands in them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from helpers.model_building import looking, make_model

from sfm_front.reports.run_report import Report
from sfm_front.types import (
    Candidate,
    ModelSummary,
    RejectedPair,
    Rejection,
    Skipped,
    SkipReason,
    StepReport,
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


STEPS = [
    StepReport("ä 1.jpg", image_id=1, num_keypoints=90, seconds={"sift": 0.25}),
    StepReport("broken.jpg", skipped=Skipped("broken.jpg", SkipReason.TRUNCATED, "half a JPEG")),
    StepReport(
        "b.jpg",
        image_id=2,
        num_keypoints=80,
        candidates=(Candidate(1, 0.123456, 40),),
        most_relevant="ä 1.jpg",
        verified=("ä 1.jpg",),
        registered=("ä 1.jpg", "b.jpg"),
        num_registered=2,
        num_points=50,
        seconds={"sift": 0.5, "map": 0.125},
        events=("model started",),
    ),
    StepReport(
        "c.jpg",
        image_id=3,
        candidates=(Candidate(2, 0.9, 12), Candidate(1, 0.95, 3)),
        most_relevant="b.jpg",
        rejected=(RejectedPair(3, 1, Rejection.NO_EPIPOLAR_GEOMETRY, 31, 9),),
        num_registered=2,
        num_points=50,
    ),
]


@pytest.fixture
def report(tmp_path):
    with Report(tmp_path) as report:
        for step in STEPS:
            report.add(step)
        yield report


def finish(report: Report, output: Path) -> dict:
    models = [
        summary(output, 0, ["ä 1.jpg", "b.jpg"], error_px=0.5, points=300),
        summary(output, 1, ["ä 1.jpg"], error_px=1.5, points=100),
    ]
    return report.finish(
        models, {3: "no verified matches"}, seconds={"export": 0.75}, events=["refined"]
    )


@pytest.mark.usefixtures("report")
def test_a_line_of_retrieval_for_each_photo_that_is_used(tmp_path):
    lines = (tmp_path / "retrieval.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line) for line in lines] == [
        {"name": "ä 1.jpg", "most_relevant": None, "candidates": []},
        {
            "name": "b.jpg",
            "most_relevant": "ä 1.jpg",
            "candidates": [
                {
                    "name": "ä 1.jpg",
                    "cosine": 0.12346,
                    "inliers": 40,
                    "verified": True,
                    "rejected": None,
                }
            ],
        },
        {
            "name": "c.jpg",
            "most_relevant": "b.jpg",
            "candidates": [
                {
                    "name": "b.jpg",
                    "cosine": 0.9,
                    "inliers": 12,
                    "verified": False,
                    "rejected": None,
                },
                {
                    "name": "ä 1.jpg",
                    "cosine": 0.95,
                    "inliers": 3,
                    "verified": False,
                    "rejected": {"reason": "no epipolar geometry", "matches": 31, "inliers": 9},
                },
            ],
        },
    ]
    assert "ä 1.jpg" in lines[0]  # readable, not escaped


def test_retrieval_is_on_disk_before_the_next_photo(tmp_path):
    with Report(tmp_path) as report:
        report.add(STEPS[0])
        assert len((tmp_path / "retrieval.jsonl").read_text(encoding="utf-8").splitlines()) == 1


def test_the_file_is_what_finish_returns(report, tmp_path):
    content = finish(report, tmp_path)
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8")) == content
    assert {path.name for path in tmp_path.iterdir()} == {"report.json", "retrieval.jsonl"}


def test_a_row_a_photo_in_their_order(report, tmp_path):
    first, broken, second, third = finish(report, tmp_path)["photos"]
    assert [row["name"] for row in (first, broken, second, third)] == [s.name for s in STEPS]
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
    assert second["verified_pairs"] == 1
    assert second["keypoints"] == 80
    assert second["seconds"] == {"sift": 0.5, "map": 0.125}
    assert second["events"] == ["model started"]
    assert (third["registered"], third["model"]) == (False, None)
    assert third["why_not_registered"] == "no verified matches"
    assert first["why_not_registered"] is None


def test_models_and_the_end(report, tmp_path):
    content = finish(report, tmp_path)
    assert content["models"] == [
        {
            "path": "sparse/0",
            "registered": 2,
            "points3D": 300,
            "mean_reprojection_error_px": 0.5,
            "mean_track_length": 3.25,
        },
        {
            "path": "sparse/1",
            "registered": 1,
            "points3D": 100,
            "mean_reprojection_error_px": 1.5,
            "mean_track_length": 3.25,
        },
    ]
    assert content["end"] == {"seconds": {"export": 0.75}, "events": ["refined"]}


def test_totals(report, tmp_path):
    totals = finish(report, tmp_path)["totals"]
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
    }


def test_work_by_quarter_is_what_a_photo_waits_for_in_its_turn(tmp_path):
    with Report(tmp_path) as report:
        for number in range(1, 9):
            seconds = {"match": float(number), "refine": 100.0, "sift": 10.0, "read": 1.0}
            report.add(StepReport(f"{number}.jpg", image_id=number, seconds=seconds))
        content = report.finish([], {}, seconds={}, events=())
    assert content["totals"]["median_seconds_by_quarter"] == [1.5, 3.5, 5.5, 7.5]


def test_without_models_there_is_still_a_report(tmp_path):
    with Report(tmp_path) as report:
        report.add(STEPS[1])
        content = report.finish([], {}, seconds={}, events=[])
    assert content["models"] == []
    assert content["totals"]["registered"] == 0
    assert content["totals"]["mean_reprojection_error_px"] is None
