"""Flights by folder and pause."""

from __future__ import annotations

from datetime import datetime, timedelta

from sfm_front.georeference.flight_grouping import Taken, flights_of

NOON = datetime(2026, 5, 1, 12)


def at(seconds: float, name: str) -> Taken:
    return Taken(name, NOON + timedelta(seconds=seconds))


def test_a_pause_begins_another_flight_in_whatever_order_photos_come() -> None:
    photos = {1: at(0, "a"), 2: at(900, "c"), 3: at(60, "b"), 4: at(1000, "d")}
    flights = flights_of(photos)
    assert flights[1] == flights[3] != flights[2] == flights[4]


def test_another_folder_is_another_flight() -> None:
    flights = flights_of({1: at(0, "one/a"), 2: at(1, "two/a")})
    assert flights[1] != flights[2]


def test_photos_without_a_time_are_of_one_flight() -> None:
    assert set(flights_of({1: Taken("a", None), 2: Taken("b", None)}).values()) == {0}
