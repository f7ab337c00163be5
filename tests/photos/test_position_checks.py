"""Positions that cannot be are left out with a reason, and unusual ones that can be are kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sfm_front.geometry.enu import LocalFrame
from sfm_front.photos.position_checks import LeftOut, check_positions
from sfm_front.types import Float64Array, GeoPosition

HOME = LocalFrame(47.0, 8.0, 500.0)


def at(enu: Float64Array, frame: LocalFrame = HOME) -> list[GeoPosition]:
    """(N, 3) metres east, north and up of a place → positions."""
    return [GeoPosition(*place) for place in frame.to_wgs84(enu).tolist()]


def flight(num: int = 40, *, length_m: float = 300.0, seed: int = 0) -> list[GeoPosition]:
    """A strip of photos with some noise, 80 m up."""
    noise = np.random.default_rng(seed).normal(0, 2.0, (num, 3))
    return at(noise + np.linspace([0, 0, 80], [length_m, 0, 80], num))


def left_out(positions: list[GeoPosition]) -> dict[int, LeftOut]:
    """Reasons by index; all others are usable, each as it was."""
    checked = check_positions(dict(enumerate(positions)))
    assert checked.usable.keys() | checked.left_out.keys() == set(range(len(positions)))
    assert not checked.usable.keys() & checked.left_out.keys()
    assert all(checked.usable[i] == positions[i] for i in checked.usable)
    return checked.left_out


def test_a_flight_is_all_usable() -> None:
    assert left_out(flight()) == {}
    for num in range(6):
        assert left_out(flight()[:num]) == {}


def test_no_fix() -> None:
    positions = flight()
    positions[0] = positions[7] = GeoPosition(0.0, -0.0, 80.0)
    assert left_out(positions) == {0: LeftOut.NO_FIX, 7: LeftOut.NO_FIX}
    assert left_out([GeoPosition(0.0, 0.0)]) == {0: LeftOut.NO_FIX}


@pytest.mark.parametrize("altitude_m", [None, 0.0])
def test_no_altitude_where_others_have_one(altitude_m: float | None) -> None:
    positions = flight()
    for i in (0, 5, 6):
        positions[i] = GeoPosition(47.0, 8.001 + i * 1e-5, altitude_m)
    assert left_out(positions) == dict.fromkeys((0, 5, 6), LeftOut.NO_ALTITUDE)


def test_where_most_have_no_altitude_all_are_kept_and_0_is_none() -> None:
    places = flight(9)
    positions = dict(enumerate(places))
    for i in range(5):
        positions[i] = GeoPosition(places[i].latitude_deg, places[i].longitude_deg, 0.0)
    checked = check_positions(positions)
    assert checked.left_out == {}
    assert [checked.usable[i].altitude_m for i in range(5)] == [None] * 5
    assert all(checked.usable[i] == places[i] for i in range(5, 9))


def test_a_frozen_fix_is_left_out_altogether() -> None:
    positions = flight()
    positions[10:16] = [positions[10]] * 6
    assert left_out(positions) == dict.fromkeys(range(10, 16), LeftOut.FROZEN)


def test_a_frozen_fix_may_have_altitudes_that_are_not() -> None:
    """As of another sensor."""
    positions = flight()
    for i in range(10, 14):
        positions[i] = replace(positions[10], altitude_m=580.0 + i % 3)
    assert left_out(positions) == dict.fromkeys(range(10, 14), LeftOut.FROZEN)


def test_a_fix_that_was_repeated_over_less_than_its_error_is_kept() -> None:
    """As of a phone round a statue: 0.3 m are the last digit of its numbers."""
    positions = [replace(position, horizontal_sigma_m=16.0) for position in flight(length_m=30)]
    positions[10:13] = [positions[10]] * 3
    assert left_out(positions) == {}
    positions = [replace(position, horizontal_sigma_m=0.02) for position in positions]
    assert left_out(positions) == dict.fromkeys(range(10, 13), LeftOut.FROZEN)


def test_two_photos_of_one_place_are_nothing_unusual() -> None:
    positions = flight()
    positions[11] = positions[10]
    assert left_out(positions) == {}


def test_a_receiver_that_freezes_for_most_of_a_flight_is_found() -> None:
    positions = flight()
    positions[4:] = [positions[4]] * 36
    assert left_out(positions) == dict.fromkeys(range(4, 40), LeftOut.FROZEN)


@pytest.mark.parametrize("exposures", [3, 5])
def test_brackets_of_exposures_at_each_stop_are_kept(exposures: int) -> None:
    positions = [position for position in flight(12) for _ in range(exposures)]
    assert left_out(positions) == {}
    # As where some of the photos were sorted out by hand.
    del positions[1 : exposures + 3]
    assert left_out(positions) == {}


def test_a_series_from_a_tripod_is_kept() -> None:
    assert left_out(30 * [GeoPosition(47.0, 8.0, 500.0)]) == {}


def test_a_climb_on_the_spot_is_kept() -> None:
    climb = [GeoPosition(47.0, 8.0, 500.0 + i) for i in range(20)]
    assert left_out(climb) == {}
    assert left_out(flight() + climb) == {}


@pytest.mark.parametrize("distance_m", [3e3, 6e4, 3e6])
def test_far_from_all_others(distance_m: float) -> None:
    positions = flight()
    positions[3] = at(np.array([[0.0, distance_m, 80.0]]))[0]
    assert left_out(positions) == {3: LeftOut.FAR_AWAY}
    assert left_out(positions[:6]) == {3: LeftOut.FAR_AWAY}


def test_two_that_are_far_away_together() -> None:
    """As where a drone starts with the last fix of the flight before."""
    positions = at(np.array([[0.0, -2e5, 80.0], [1.0, -2e5, 80.5]])) + flight()
    assert left_out(positions) == dict.fromkeys((0, 1), LeftOut.FAR_AWAY)


def test_an_error_of_some_hundred_metres_is_not_for_these_checks() -> None:
    positions = flight()
    positions[3] = at(np.array([[0.0, 400.0, 80.0]]))[0]
    assert left_out(positions) == {}


@pytest.mark.parametrize("length_m", [2e4, 1.5e5])
def test_a_long_corridor_is_kept(length_m: float) -> None:
    assert left_out(flight(300, length_m=length_m)) == {}
    # It ends with a leap, shorter than the rest is long.
    end = at(np.array([[1.25 * length_m, 0.0, 80.0]]))
    assert left_out(flight(300, length_m=length_m) + end) == {}


def test_a_second_site_is_kept() -> None:
    second = at(np.random.default_rng(1).normal([8e4, 0, 80], 50.0, (10, 3)))
    assert left_out(flight(60) + second) == {}


def test_nobody_knows_who_is_right_of_few() -> None:
    far = at(np.array([[0.0, 1e5, 80.0]]))
    for num in (1, 2, 3):
        assert left_out(flight()[:num] + far) == {}


@pytest.mark.parametrize("longitude_deg", [180.0, -180.0])
def test_the_date_line_is_no_gap(longitude_deg: float) -> None:
    frame = LocalFrame(-17.0, longitude_deg, 0.0)
    enu = np.random.default_rng(2).normal([0, 0, 100], 80.0, (50, 3))
    positions = at(enu, frame)
    assert len({position.longitude_deg > 0 for position in positions}) == 2
    assert left_out(positions) == {}


def test_one_reason_does_not_hide_another() -> None:
    positions = flight()
    positions[0] = GeoPosition(0.0, 0.0, 80.0)
    positions[1] = GeoPosition(positions[1].latitude_deg, positions[1].longitude_deg)
    positions[2:6] = [positions[2]] * 4
    positions[6] = GeoPosition(-47.0, 8.0, 80.0)
    reasons = left_out(positions)
    assert [reasons[i].name for i in (0, 1, 2, 6)] == [
        "NO_FIX",
        "NO_ALTITUDE",
        "FROZEN",
        "FAR_AWAY",
    ]
    assert len(reasons) == 7
