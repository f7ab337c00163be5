"""The orders in which photos are tried."""

from __future__ import annotations

import pytest

from sfm_front.errors import ConfigError
from sfm_front.evaluation.tuning.arrangements import ARRANGEMENTS, arrange, check_arrangements
from sfm_front.photos.source import order_photos
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


def test_an_unknown_arrangement_is_refused():
    check_arrangements(["half", "name"])
    with pytest.raises(ConfigError, match="no arrangement backwards; there are name, shuffle-1"):
        check_arrangements(["name", "backwards"])
