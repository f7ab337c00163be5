"""What photos waited for, from made-up events."""

from __future__ import annotations

import json
from datetime import datetime, timedelta, timezone
from typing import Any

import pytest

from sfm_front.evaluation.live.timeline import Refinement, read_timeline

START = datetime(2026, 5, 4, 10, 0, tzinfo=timezone.utc)
# Events have milliseconds.
TOLERANCE_S = 1e-3


def at(seconds: float, event: str, /, **fields: Any) -> str:
    time = START + timedelta(seconds=seconds)
    return json.dumps({"time": time.isoformat(timespec="milliseconds"), "event": event, **fields})


def stages(**seconds: float) -> dict[str, float]:
    return {"read": 0.25, "sift": 0.5, **seconds}


LINES = [
    at(0.0, "session_started"),
    at(1.25, "photo_arrived", name="a.jpg"),
    at(2.0, "photo_added", name="a.jpg", seconds=stages(match=0.125)),
    at(2.0, "photo_waiting", name="a.jpg"),
    at(2.75, "photo_arrived", name="b.jpg"),
    at(3.0, "model_refined", num_registered=2, seconds=0.0625),
    at(3.5, "photo_added", name="b.jpg", seconds=stages(match=0.25, map=0.5, refine=0.0625)),
    at(3.5, "photo_placed", name="a.jpg"),
    at(3.625, "photo_placed", name="b.jpg"),
    at(4.0, "photo_skipped", name="c.jpg"),
    at(5.0, "model_refined", num_registered=2, seconds=2.0),
    at(6.0, "photo_placed", name="a.jpg"),
]
COMPLETE = {
    name: START.timestamp() + seconds
    for name, seconds in {"a.jpg": 1.0, "b.jpg": 2.5, "c.jpg": 3.75}.items()
}


def test_a_photo_waits_from_its_copy_to_its_first_pose():
    first, second, third = read_timeline(COMPLETE, LINES).photos
    assert first.noticed_s == pytest.approx(0.25, abs=TOLERANCE_S)
    assert first.placed_s == pytest.approx(2.5, abs=TOLERANCE_S)
    assert first.arrived_to_placed_s == pytest.approx(2.25, abs=TOLERANCE_S)
    assert second.placed_s == pytest.approx(1.125, abs=TOLERANCE_S)
    assert (third.noticed_s, third.placed_s, third.arrived_to_placed_s) == (None, None, None)


def test_what_runs_ahead_is_not_part_of_the_turn():
    first, second, third = read_timeline(COMPLETE, LINES).photos
    assert (first.turn_s, second.turn_s, third.turn_s) == (0.125, 0.8125, 0)


def test_a_refinement_after_the_last_photo_holds_up_none():
    assert read_timeline(COMPLETE, LINES).refinements == (
        Refinement(2, 0.0625, while_photos_came=True),
        Refinement(2, 2.0, while_photos_came=False),
    )
