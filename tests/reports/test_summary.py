"""The closing summary: a run in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sfm_front.reports.run_summary import (
    AuditOutcome,
    Latency,
    ModelOutcome,
    Outcome,
    PhotoOutcome,
    RunSummary,
    Totals,
)
from sfm_front.reports.summary import closing_summary
from sfm_front.types import Skipped, SkipReason

PLACED = PhotoOutcome("a.jpg", 1, 0, None, 90, None, 0, 0, (), {}, ())

SOUND = AuditOutcome(8, 0, 0.0, False, (), 0.0)


def waiting(name: str, why: str) -> PhotoOutcome:
    return replace(PLACED, name=name, model=None, why_not=why)


def summary(photos: Sequence[Outcome], num_models: int = 1) -> RunSummary:
    used = [photo for photo in photos if isinstance(photo, PhotoOutcome)]
    registered = sum(photo.model is not None for photo in used)
    models = [
        ModelOutcome(f"sparse/{n}", registered, 1234, 0.4321, 3.5, SOUND) for n in range(num_models)
    ]
    return RunSummary(
        photos=tuple(photos),
        models=tuple(models),
        end_seconds={},
        end_events=(),
        totals=Totals(
            num_photos=len(photos),
            num_used=len(used),
            num_registered=registered,
            num_points=1234,
            mean_reprojection_error_px=0.4321,
            wall_seconds=65.0,
            seconds_by_stage={"sift": 4.0, "map": 2.0},
            median_seconds_by_quarter=(1.0, 2.0, 2.5, 2.25),
            peak_memory_bytes=None,
            latency=Latency(0.789, 1.5, 2.0),
        ),
    )


def test_the_summary_says_what_became_of_all():
    photos = [
        PLACED,
        replace(PLACED, name="b.jpg"),
        replace(waiting("c.jpg", "no verified matches"), hint="take one between"),
        Skipped("d.jpg", SkipReason.EMPTY_FILE),
        Skipped("e.jpg", SkipReason.TOO_SMALL, "20 x 20"),
    ]
    told = [
        "2 of 3 photos are in one model; 1 found no place, because of this: no verified matches; "
        "2 files were skipped (empty file, too small).",
        f"  {Path('out/sparse/0')}: 2 photos, 1234 points, 0.43 px",
        "skipped:",
        "  d.jpg: empty file",
        "  e.jpg: too small: 20 x 20",
        "in no model:",
        "  c.jpg: no verified matches",
        "    take one between",
        "it took 1:05, 13.00 s a photo",
    ]
    assert closing_summary(summary(photos), Path("out")).splitlines() == told
    assert closing_summary(summary(photos), Path("out"), with_stages=True).splitlines() == [
        *told,
        "seconds a photo by stage, which overlap: sift 0.800, map 0.400",
        "work per photo without global refinement, median by quarter of the run: "
        "1.00 s, 2.00 s, 2.50 s, 2.25 s",
    ]


def test_look_alikes_are_named():
    run = replace(summary([PLACED]), look_alikes=((("a.jpg", "b.jpg"), ("c.jpg",)),))
    line = "taken for one place and taken apart, look-alikes: a.jpg, b.jpg and c.jpg"
    assert line in closing_summary(run, Path("out")).splitlines()


def test_many_reasons_are_counted():
    photos = [waiting(f"{n}.jpg", "far off" if n % 3 else "blurred") for n in range(30)]
    assert closing_summary(summary(photos), Path("out")).splitlines()[-4:-1] == [
        "in no model: 30 photos (each in report.json)",
        "  20 × far off",
        "  10 × blurred",
    ]


def test_without_a_model_it_says_what_to_do():
    text = closing_summary(summary([waiting("a.jpg", "no verified matches")], 0), Path("out"))
    assert text.startswith("No model could be built from 1 photo: it takes at least two")


def test_latency_is_told_of_a_watched_folder():
    told = closing_summary(summary([PLACED]), Path("out"), watched=True)
    line = "from arrival to pose: median 0.79 s, 95 % within 1.50 s, worst 2.00 s"
    assert line in told.splitlines()
    assert "arrival" not in closing_summary(summary([PLACED]), Path("out"))


def test_without_a_pose_there_is_no_latency_to_tell():
    run = summary([waiting("a.jpg", "no verified matches")], 0)
    run = replace(run, totals=replace(run.totals, latency=None))
    assert "arrival" not in closing_summary(run, Path("out"), watched=True)


def test_a_doubtful_model_is_told_with_the_photos_to_look_at():
    others = tuple(f"{n}.jpg" for n in range(10, 20))
    doubtful = AuditOutcome(80, 9, 0.125, True, (others, tuple(f"{n}.jpg" for n in range(6))), 0.6)
    told = summary([PLACED])
    told = replace(told, models=(replace(told.models[0], audit=doubtful),))
    line = closing_summary(told, Path("out")).splitlines()[2].strip()
    assert line == (
        "doubtful: 9 of its 80 pairs, with 12.5% of the matches, contradict it; "
        "look first at 0.jpg, 1.jpg, 2.jpg, 3.jpg, 4.jpg, ..."
    )
