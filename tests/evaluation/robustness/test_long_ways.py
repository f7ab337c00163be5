"""Two flights become one model, and a round trip is closed."""

from __future__ import annotations

from pathlib import Path

import pytest

from sfm_front.errors import ConfigError
from sfm_front.evaluation.robustness.long_ways import round_trip, two_flights
from sfm_front.events import PhotoAdded
from sfm_front.session.options import SessionOptions

OPTIONS = SessionOptions(global_descriptor="vlad", threads=1)


def ignore(_: PhotoAdded) -> None:
    pass


@pytest.mark.slow
def test_bridge_photos_that_come_last_make_one_model_of_two_flights(tmp_path: Path) -> None:
    flown = two_flights(25, 250, tmp_path, OPTIONS, bridges_last=True, seed=0, note=ignore)
    assert len(flown.seconds) == 55
    assert flown.num_registered == 55
    assert all(row >= 50 for row in flown.joined_at)
    assert flown.joined_at
    assert flown.auc[1] > 0.8


@pytest.mark.slow
def test_a_round_trip_is_compared_with_a_model_of_all_its_pairs(tmp_path: Path) -> None:
    flown, at_once = round_trip(40, 250, tmp_path, OPTIONS, seed=0, note=ignore)
    assert flown.num_registered == 40
    assert at_once[1] > 0.8
    assert flown.auc[1] > at_once[1] - 0.1


def test_flights_too_short_to_have_a_gap_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="at least 20 photos"):
        two_flights(5, 250, tmp_path, OPTIONS, bridges_last=True, seed=0, note=ignore)
