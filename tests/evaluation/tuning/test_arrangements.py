"""The orders in which photos are tried."""

from __future__ import annotations

import pytest

from sfm_front.errors import ConfigError
from sfm_front.evaluation.tuning.arrangements import ARRANGEMENTS, arrange, check_arrangements
from sfm_front.photos.source import order_photos, shuffled
from sfm_front.types import PhotoPath


def test_arrangements_are_what_they_say(tmp_path):
    photos = [PhotoPath(f"{number}.jpg", tmp_path) for number in range(9)]
    arranged = {name: arrange(photos, name) for name in ARRANGEMENTS}
    assert arranged["name"] == photos
    assert arranged["half"] == photos[::2]
    # As ``reconstruct --order random`` has them.
    assert arranged["shuffle-1"] == order_photos(photos, "random", seed=1)
    assert arranged["shuffle-2"] == order_photos(photos, "random", seed=2)
    assert arranged["shuffle-1"] != arranged["shuffle-2"]


def test_photos_are_thinned_before_they_are_ordered():
    photos = range(20)
    assert arrange(photos, "whole") == arrange(photos, "whole-name") == list(photos)
    assert arrange(photos, "third") == [0, 3, 6, 9, 12, 15, 18]
    assert arrange(photos, "third-shuffle-11") == shuffled([0, 3, 6, 9, 12, 15, 18], 11)
    assert arrange(photos, "half-flights") == [0, 12, 2, 14, 4, 16, 6, 18, 8, 10]


@pytest.mark.parametrize(
    ("number", "arriving"),
    [(10, [0, 6, 1, 7, 2, 8, 3, 9, 4, 5]), (7, [0, 5, 1, 6, 2, 3, 4]), (2, [0, 1]), (0, [])],
)
def test_two_flights_meet_only_at_the_end(number, arriving):
    assert arrange(range(number), "flights") == arriving


def test_an_unknown_arrangement_is_refused():
    check_arrangements(["half", "name", "third-shuffle-12"])
    with pytest.raises(ConfigError, match="no arrangement backwards; there are name, flights"):
        check_arrangements(["name", "backwards"])
    for name in ("half-backwards", "shuffle", "shuffle-one", "shuffle--1", "shuffle-1-half", ""):
        with pytest.raises(ConfigError, match="no arrangement"):
            check_arrangements([name])
