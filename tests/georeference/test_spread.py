"""What positions fix, and the words for what they do not."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.flight_making import Flight, flight, line, strips, thrown

from sfm_front.errors import ConfigError
from sfm_front.georeference.alignment import align
from sfm_front.georeference.spread import GeoreferenceState, SpreadOptions, Verdict, judge


def verdict(photos: Flight, level: bool = True, **options) -> Verdict:
    fixes = photos.fixes()
    found = align(photos.centres, fixes, photos.cam_from_model if level else None)
    return judge(found, fixes, SpreadOptions(**options))


@pytest.mark.parametrize("level", [True, False])
def test_spread_positions_are_metric(level):
    assert verdict(flight(strips(20), seed=0), level) == Verdict(GeoreferenceState.METRIC)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_fewer_than_three_are_nothing(number):
    photos = flight(strips(20), seed=0)
    some = Flight(
        photos.true,
        photos.enu_from_model,
        *(rows[:number] for rows in (photos.centres, photos.cam_from_model, photos.enu)),
    )
    found = verdict(some, level=number > 0)
    assert found.state is GeoreferenceState.NONE
    assert "3 are needed" in found.reasons[0]


def test_one_place_is_nothing():
    photos = flight(strips(20), seed=0)
    photos.enu[:] = photos.enu[0]
    found = verdict(photos)
    assert found.state is GeoreferenceState.NONE
    assert "coincide" in found.reasons[0]


def test_four_are_provisional_and_five_are_enough():
    square = np.array([(0, 0, 60), (0, 80, 60), (80, 80, 60), (80, 0, 60), (40, 40, 60.0)])
    four = verdict(flight(square[:4], seed=0))
    assert four.state is GeoreferenceState.PROVISIONAL
    assert four.reasons[0] == "4 positions that agree, 5 are needed"
    assert verdict(flight(square, seed=0)).state is GeoreferenceState.METRIC


def test_outliers_do_not_count():
    square = np.array([(0, 0, 60), (0, 80, 60), (80, 80, 60), (80, 0, 60), (40, 40, 60.0)])
    photos = flight(square, seed=0)
    thrown(photos, np.array([4]), 200.0, 0)
    assert verdict(photos).reasons[0] == "4 positions that agree, 5 are needed"


def test_a_line_leaves_a_rotation_open():
    found = verdict(flight(line(20), seed=0), level=False)
    assert found.state is GeoreferenceState.PROVISIONAL
    assert len(found.reasons) == 1
    assert found.reasons[0].startswith(
        "the photos lie on a line: the rotation about it is not fixed"
    )


def test_level_cameras_on_a_line_are_metric_and_it_says_so():
    found = verdict(flight(line(20), seed=0))
    assert found.state is GeoreferenceState.METRIC
    assert found.reasons[0].startswith(
        "the photos lie on a line: the rotation about it is that of cameras held level"
    )


def test_positions_as_far_off_as_they_are_apart_leave_the_scale_open():
    found = verdict(flight(strips(20, extent_m=4.0), seed=0, noise_m=(3, 3, 3)))
    assert found.state is GeoreferenceState.PROVISIONAL
    assert any(reason.startswith("the scale is uncertain by") for reason in found.reasons)


def test_it_is_said_where_model_and_positions_differ_by_more_than_these_claim():
    photos = flight(strips(40), seed=0, noise_m=(0.5, 0.5, 30.0))
    found = verdict(photos)
    assert any("in height, where positions claim 10 m" in reason for reason in found.reasons)
    assert not any("in the plane" in reason for reason in found.reasons)


def test_without_heights_up_is_open():
    photos = flight(strips(20), seed=0)
    photos.enu[:, 2] = np.nan
    found = verdict(photos, level=False)
    assert found.state is GeoreferenceState.PROVISIONAL
    assert "no height is known" in found.reasons


@pytest.mark.parametrize(
    "wrong", [{"min_positions": 2}, {"max_scale_sigma": 0}, {"max_rotation_sigma_deg": -1}]
)
def test_options_check_themselves(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        SpreadOptions(**wrong)
