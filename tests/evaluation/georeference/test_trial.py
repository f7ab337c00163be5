"""A session on a scene with GPS: when it is metric, and how it compares with GPS."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import pytest
from helpers.locations import SAMPLES, SCRIPTS
from helpers.positioned_stream import measured, options, positions_at, taken

from sfm_front.evaluation.georeference.table import format_trials
from sfm_front.evaluation.georeference.trial import GeoreferenceTrial, run_trial
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.types import Skipped, SkipReason

NUM_PHOTOS = 14


@pytest.fixture(scope="module")
def trial() -> GeoreferenceTrial:
    flight = make_scene(NUM_PHOTOS, 250, seed=3, layout="strip")
    photos = taken(flight, positions_at(measured(flight)))
    counted: list[None] = []
    found = run_trial(
        "hills",
        [*photos, Skipped("torn.jpg", SkipReason.TRUNCATED)],
        options(),
        lambda: counted.append(None),
    )
    assert len(counted) == NUM_PHOTOS + 1
    return found


def test_each_photo_says_how_far_the_model_is(trial):
    states = [step.state for step in trial.steps]
    assert len(states) == NUM_PHOTOS + 2  # the skipped one, and the end
    assert states[0] == "none"
    assert states[trial.first_metric - 2] != "metric"
    assert states[trial.first_metric - 1 :] == ["metric"] * (len(states) - trial.first_metric + 1)
    moves = [step.move for step in trial.steps]
    assert moves[: trial.first_metric] == [None] * trial.first_metric
    assert None not in moves[trial.first_metric :]
    # What was said first was honest.
    assert 0 < trial.largest_move.cameras < 3


def test_the_model_is_compared_with_gps_as_it_stands_and_fitted(trial):
    assert (trial.registered, trial.state) == (NUM_PHOTOS, "metric")
    # The median of the length of noise of 0.5, 0.5 and 1 m is about 1.1 m.
    assert trial.as_it_stands_m == pytest.approx(1.1, abs=0.5)
    assert trial.free_fit_m == pytest.approx(trial.as_it_stands_m, abs=0.3)
    assert trial.scale_ratio == pytest.approx(1, abs=0.02)
    assert 0 < trial.bend_share < 0.05


def test_the_table_has_a_row_per_scene_and_what_is_said(trial):
    never = replace(
        trial,
        scene="still",
        state="none",
        first_metric=None,
        as_it_stands_m=None,
        free_fit_m=None,
        scale_ratio=None,
        bend_share=None,
        reasons=("2 positions, 3 are needed",),
        steps=trial.steps[:1],
    )
    header, _, first, second, blank, said = format_trials([trial, never]).splitlines()
    assert header.split(" | ")[3] == "metric at"
    assert first.split(" | ")[3] == f"{trial.first_metric} of {trial.photos}"
    assert second == ("| still | 14/15 | none | - | - | - | - | - | - | - | - | - |")
    assert (blank, said) == ("", "still: 2 positions, 3 are needed")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scenes", "vilage"], "did you mean village?"),
        (["--threads", "0"], "threads must be at least 1"),
    ],
)
def test_mistakes_end_in_one_line(tmp_path, arguments, message):
    script = SCRIPTS / "benchmark_georeference.py"
    done = subprocess.run(
        [sys.executable, script, *arguments, "--data", SAMPLES],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
