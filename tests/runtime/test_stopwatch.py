"""Seconds by stage, on a clock that the test turns."""

from __future__ import annotations

import pytest

from sfm_front.runtime import stopwatch
from sfm_front.runtime.stopwatch import Stopwatch


@pytest.fixture
def turn(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(stopwatch.time, "perf_counter", lambda: now[0])

    def later(seconds: float) -> None:
        now[0] += seconds

    return later


def test_a_stage_entered_twice_adds_up(turn):
    clock = Stopwatch()
    for seconds in (2.0, 3.0):
        with clock.stage("match"):
            turn(seconds)
        turn(10.0)
    with clock.stage("map"):
        turn(0.5)
    assert clock.seconds == {"match": 5.0, "map": 0.5}


def test_a_stage_that_fails_counts_too(turn):
    clock = Stopwatch()

    def fail() -> None:
        with clock.stage("map"):
            turn(4.0)
            raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        fail()
    assert clock.seconds == {"map": 4.0}


def test_a_part_of_a_stage_is_counted_apart(turn):
    clock = Stopwatch()
    with clock.stage("map"):
        turn(3.0)
    clock.move("map", "refine", 1.0)
    clock.move("map", "refine", 0.5)
    assert clock.seconds == {"map": 1.5, "refine": 1.5}
