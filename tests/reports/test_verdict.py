"""The sentence that says what came out, and how good that is."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers.report_making import METRIC, Output, summary_of

from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.camera_outcome import CameraOutcome
from sfm_front.reports.lights import Level
from sfm_front.reports.run_summary import RunSummary
from sfm_front.reports.verdict import verdict
from sfm_front.types import SkipReason, Waiting, WaitingReason

SOUND = replace(METRIC, residuals=replace(METRIC.residuals, outliers=()))


def waiting_for(*reasons: Waiting | str, of: int = 9) -> RunSummary:
    """A run of which so many photos found no place, for these reasons."""
    summary = summary_of(Output(num_photos=of, num_waiting=len(reasons)))
    placed, missing = summary.used[: of - len(reasons)], summary.used[of - len(reasons) :]
    missing = [
        replace(p, why_not=str(why), waiting=why.reason if isinstance(why, Waiting) else None)
        for p, why in zip(missing, reasons, strict=True)
    ]
    return replace(summary, photos=(*placed, *missing))


@pytest.mark.parametrize(
    ("output", "sidecar", "level", "said"),
    [
        ({"num_waiting": 0}, None, Level.GOOD, "All 9 photos are in one model."),
        ({"num_waiting": 0}, SOUND, Level.GOOD, "All 9 photos are in one model, in metres."),
        (
            {"num_waiting": 2, "why_not": "it is dark"},
            None,
            Level.FAIR,
            "7 of 9 photos are in one model; 2 found no place, because of this: it is dark.",
        ),
        (
            {"num_waiting": 0, "is_doubtful": True, "skipped": {"a": SkipReason.EMPTY_FILE}},
            None,
            Level.BAD,
            "All 9 photos are in one model, but some of their matches contradict it, as where "
            "two things look alike; 1 file was skipped (empty file).",
        ),
        (
            {"has_model": False},
            None,
            Level.BAD,
            "No model could be built from 9 photos: they overlap, but the camera hardly moved "
            "between them. Take each from another place; turning on the spot shows no depth.",
        ),
    ],
)
def test_the_sentence_says_what_came_out_and_why_it_is_no_more(output, sidecar, level, said):
    found = verdict(summary_of(Output(**output)), sidecar)
    assert (found.sentence, found.level) == (said, level)


def test_the_likely_cause_is_that_of_most_photos():
    no_pose = Waiting(WaitingReason.NO_POSE, 12)
    other = Waiting(WaitingReason.NO_POSE, 9)
    alone = Waiting(WaitingReason.NO_MATCHES)
    assert verdict(waiting_for(no_pose, other), None).sentence == (
        "7 of 9 photos are in one model; 2 found no place, "
        "because they share too little with the photos in the model."
    )
    found = verdict(waiting_for(alone, no_pose, alone, alone), None)
    assert found.level is Level.BAD
    assert found.sentence == (
        "Only 5 of 9 photos are in one model; 4 found no place, "
        "mostly because they share too little with any other photo."
    )


def test_photos_without_details_may_be_blurred():
    summary = waiting_for(*[Waiting(WaitingReason.NO_MATCHES)] * 2)
    photos = [
        photo if photo.model is not None else replace(photo, num_keypoints=40)
        for photo in summary.used
    ]
    found = verdict(replace(summary, photos=tuple(photos)), None).sentence
    assert "because they share few details with any photo, as if blurred or bare" in found


def test_several_models_are_said():
    summary = summary_of(Output(num_waiting=0))
    models = tuple(replace(summary.models[0], num_registered=n) for n in (6, 2, 1))
    assert verdict(replace(summary, models=models), None).sentence == (
        "6 of 9 photos are in one model; 3 more in 2 others, which too few matches link to it."
    )


def test_what_makes_a_light_doubtful_is_said():
    summary = summary_of(Output(num_waiting=0))
    differs = replace(SOUND, reasons=("model and positions differ by 32 m in height",))
    found = verdict(summary, differs)
    assert found.level is Level.FAIR
    assert found.sentence == (
        "All 9 photos are in one model, in metres, "
        "but model and positions differ by 32 m in height."
    )
    camera = CameraOutcome(
        model_path="sparse/0",
        camera_id=1,
        num_photos=9,
        lens="SIMPLE_PINHOLE",
        params=(1300.0, 500.0, 400.0),
        focal_px=1300.0,
        prior_focal_px=1000.0,
        focal_sigma=None,
        is_determined=None,
    )
    assert verdict(replace(summary, cameras=(camera,)), SOUND).level is Level.FAIR
    assert verdict(replace(summary, cameras=(camera,)), differs).level is Level.BAD
    held = replace(SOUND, reasons=("the frame is held: …; the scale is uncertain",))
    assert "but positions no longer fix its place" in verdict(summary, held).sentence
    none = replace(
        SOUND,
        state=GeoreferenceState.NONE,
        models_in_enu=(),
        residuals=None,
        reasons=("2 positions, 3 are needed",),
    )
    assert "positions do not put it into metres (2 positions" in verdict(summary, none).sentence
    refused = replace(SOUND, control_points=ControlReport(file="gcp.txt", not_used="line 7"))
    assert "its control points could not be used" in verdict(summary, refused).sentence


@pytest.mark.parametrize(
    ("num_verified", "advice"),
    [
        ([0, 1, 2, 2], "the camera hardly moved"),
        ([0, 1], "the camera hardly moved"),
        ([0, 1, 0, 0], "overlap by two thirds"),
        ([0, 0], "overlap by two thirds"),
        ([0], "at least two"),
    ],
)
def test_where_photos_overlap_but_give_no_model_the_camera_did_not_move(num_verified, advice):
    summary = summary_of(Output(num_photos=len(num_verified), has_model=False))
    photos = [replace(p, num_verified=n) for p, n in zip(summary.used, num_verified, strict=True)]
    assert advice in verdict(replace(summary, photos=tuple(photos)), None).sentence


def test_where_no_photo_came_or_none_could_be_read_more_overlap_is_no_advice():
    nothing = summary_of(Output(num_photos=0, num_waiting=0, has_model=False))
    assert verdict(nothing, None).sentence == "No model could be built: no photo came."
    skipped = {"a.jpg": SkipReason.TRUNCATED, "b": SkipReason.TRUNCATED, "c": SkipReason.DUPLICATE}
    unread = summary_of(Output(num_photos=0, num_waiting=0, has_model=False, skipped=skipped))
    assert verdict(unread, None).sentence == (
        "No model could be built: no photo could be read; 3 files were skipped (mostly truncated)."
    )
    # No reason is that of most.
    skipped["d"] = SkipReason.EMPTY_FILE
    unread = summary_of(Output(num_photos=0, num_waiting=0, has_model=False, skipped=skipped))
    assert verdict(unread, None).sentence.endswith(
        "4 files were skipped (truncated, duplicate, empty file)."
    )
