"""The table of tuned options, and what is tried for a name."""

from __future__ import annotations

import pytest
from helpers.locations import ROOT

from sfm_front.errors import ConfigError
from sfm_front.evaluation.tuning.constants import CONSTANTS, make_sweep
from sfm_front.session.options import SessionOptions

BASE = SessionOptions(threads=1)
TUNING = ROOT / "sfm_front" / "evaluation" / "TUNING.md"


@pytest.mark.parametrize("constant", CONSTANTS, ids=lambda constant: constant.name)
def test_the_table_has_the_current_value_among_others(constant):
    assert len(constant.values) >= 3
    sweep = make_sweep(constant.name, None, BASE)
    assert tuple(sweep.options) == constant.values
    assert sweep.current in constant.values  # else the sweep has added it
    assert sweep.options[sweep.current] == BASE
    assert len(set(sweep.options.values())) == len(constant.values)


def test_every_name_stands_in_the_tuning_file():
    text = TUNING.read_text(encoding="utf-8")
    assert [c.name for c in CONSTANTS if f"`{c.name}`" not in text] == []


def test_a_path_means_the_same_as_its_name():
    assert make_sweep("guided.max_ratio", None, BASE) == make_sweep("guided-ratio", None, BASE)


def test_values_may_be_given_and_the_current_one_is_added():
    sweep = make_sweep("guided-ratio", ["0.9", "0.5"], BASE)
    assert list(sweep.options) == [0.5, 0.7, 0.9]
    assert sweep.options[0.9].guided.max_ratio == 0.9


def test_any_option_can_be_tried_with_values():
    sweep = make_sweep("verification.min_inliers", ["20"], BASE)
    assert [tried.verification.min_inliers for tried in sweep.options.values()] == [15, 20]
    with pytest.raises(ConfigError, match="give some with --values"):
        make_sweep("verification.min_inliers", None, BASE)


@pytest.mark.parametrize(
    ("name", "known"),
    [("gided-ratio", "guided-ratio"), ("min_gain", "atlas.mapper.calibration.min_gain")],
)
def test_an_unknown_name_gets_the_nearest_known_one(name, known):
    with pytest.raises(ConfigError, match=f"{name}: no such option; did you mean {known}?"):
        make_sweep(name, None, BASE)
