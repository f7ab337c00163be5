"""Options of a session by dotted path."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sfm_front.errors import ConfigError
from sfm_front.evaluation.tuning.option_paths import (
    check_path,
    nearest,
    parse_value,
    paths,
    value_at,
    with_value,
)
from sfm_front.session.options import SessionOptions

OPTIONS = SessionOptions(threads=1)


def test_options_of_every_depth_have_a_path():
    known = list(paths(OPTIONS))
    assert {"seed", "guided.max_ratio", "atlas.mapper.calibration.min_gain"} <= set(known)
    assert "guided" not in known
    for path in known:
        check_path_unless_of_description(path)
        assert isinstance(value_at(OPTIONS, path), bool | int | float | str)


def check_path_unless_of_description(path):
    if path in ("max_image_size", "max_features", "global_descriptor"):
        with pytest.raises(ConfigError, match="how photos are described"):
            check_path(path)
    else:
        check_path(path)


def test_one_value_changes_and_nothing_else():
    changed = with_value(OPTIONS, "atlas.mapper.schedule.growth", 1.5)
    assert changed.atlas.mapper.schedule.growth == 1.5
    assert changed != OPTIONS
    assert with_value(changed, "atlas.mapper.schedule.growth", 1.25) == OPTIONS


def test_the_seed_reaches_the_parts_that_follow_it():
    assert with_value(OPTIONS, "seed", 3).atlas.mapper.seed == 3


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("guided.max_ratio", 2.0, r"guided\.max_ratio: max_ratio must be above 0"),
        ("atlas.mapper.seed", 3, r"atlas\.mapper\.seed: follows seed; tune that"),
        ("atlas.mapper.num_threads", 3, r"num_threads: follows threads; tune that"),
    ],
)
def test_values_that_cannot_be_are_refused(path, value, message):
    with pytest.raises(ConfigError, match=message):
        with_value(OPTIONS, path, value)


def test_an_unknown_path_gets_the_nearest_known_one():
    with pytest.raises(ConfigError, match=r"did you mean guided\.max_ratio\?"):
        check_path("guided.max_rato")
    # The last part is what people remember.
    assert nearest("mapper.min_gain", paths(OPTIONS)) == "atlas.mapper.calibration.min_gain"


def test_values_are_read_as_the_option_has_them():
    assert parse_value("guided.max_ratio", "1") == 1.0
    assert isinstance(parse_value("guided.max_ratio", "1"), float)
    assert parse_value("pair_matching.min_inliers", "8") == 8
    assert parse_value("text", "true") is True
    assert parse_value("device", "cpu") == "cpu"


@pytest.mark.parametrize(
    ("path", "text", "expected"),
    [
        ("guided.max_ratio", "half", "a number"),
        ("pair_matching.min_inliers", "8.5", "an integer"),
        ("text", "1", "true or false"),
    ],
)
def test_values_of_another_type_are_refused(path, text, expected):
    with pytest.raises(ConfigError, match=f"{path}: {expected}, got '{text}'"):
        parse_value(path, text)


def test_an_option_that_is_not_set_has_no_path():
    assert "weights" not in list(paths(replace(OPTIONS, weights=None)))
