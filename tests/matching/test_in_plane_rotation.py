"""How photos are turned, and which features meet, on orientations drawn at random."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.matching.in_plane_rotation import (
    RotationOptions,
    agrees_with_rotation,
    in_plane_rotation,
    rotation_mask,
)

TOLERANCE_RAD = 0.02
DEFAULT = RotationOptions()


def keypoints(orientations: NDArray[np.float64]) -> NDArray[np.float32]:
    rows = np.zeros((len(orientations), 4), np.float32)
    rows[:, 3] = orientations
    return rows


def angle_between(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs(np.angle(np.exp(1j * (first - second))))


@pytest.mark.parametrize("turn", [0.0, 1.2, -3.1, np.pi])
def test_the_turn_of_most_is_found_whatever_the_rest_does(turn):
    rng = np.random.default_rng(0)
    first = rng.uniform(0, 2 * np.pi, 200)
    second = first + turn + rng.normal(0, 0.05, 200)
    second[:30] = rng.uniform(0, 2 * np.pi, 30)
    found = in_plane_rotation(keypoints(first), keypoints(second), DEFAULT)
    assert found is not None
    assert angle_between(np.array(found), np.array(turn)) < TOLERANCE_RAD


def test_what_turns_every_way_has_no_common_turn():
    rng = np.random.default_rng(0)
    first, second = rng.uniform(0, 2 * np.pi, (2, 200))
    assert in_plane_rotation(keypoints(first), keypoints(second), DEFAULT) is None


def test_a_handful_cannot_tell():
    few = np.linspace(0, 1, 15)
    assert in_plane_rotation(keypoints(few), keypoints(few), DEFAULT) is None
    assert in_plane_rotation(keypoints(np.zeros(0)), keypoints(np.zeros(0)), DEFAULT) is None
    enough = np.linspace(0, 1, 16)
    assert in_plane_rotation(keypoints(enough), keypoints(enough), DEFAULT) == pytest.approx(0)


def test_how_many_must_agree_and_how_closely_is_an_option():
    rng = np.random.default_rng(0)
    first = rng.uniform(0, 2 * np.pi, 200)
    second = first + np.deg2rad(rng.uniform(-15, 15, 200))
    second[:60] = rng.uniform(0, 2 * np.pi, 60)

    def found(**options: float) -> float | None:
        return in_plane_rotation(keypoints(first), keypoints(second), RotationOptions(**options))

    assert found() is None
    assert found(min_agreeing=0.65) is not None
    assert found(min_agreeing=0.65, tolerance_deg=10) is None
    assert found(min_agreeing=0.65, min_matches=200) is not None
    assert found(min_agreeing=0.65, min_matches=201) is None


@pytest.mark.parametrize("turn", [0.0, 3.0, -2.0, 7.0])
def test_matches_that_turn_with_the_photos_are_told_from_others(turn):
    off = np.deg2rad([0, 29, -29, 31, -31, 180, 331, 389])
    first = np.linspace(-3, 3, len(off))
    alike = agrees_with_rotation(keypoints(first), keypoints(first + turn + off), turn, 30.0)
    assert alike.tolist() == [True, True, True, False, False, False, True, True]
    stricter = agrees_with_rotation(keypoints(first), keypoints(first + turn + off), turn, 28.0)
    assert stricter.tolist() == [True] + [False] * 7


@pytest.mark.parametrize(
    "options",
    [DEFAULT, RotationOptions(tolerance_deg=40), RotationOptions(num_sectors=4)],
    ids=["default", "tolerance", "sectors"],
)
@pytest.mark.parametrize("turn", [0.0, 0.4, 3.0, -2.0, 7.0])
def test_those_that_agree_meet_once_and_those_that_do_not_never(turn, options):
    rng = np.random.default_rng(1)
    # Outside the circle once round, too: orientations are defined up to whole turns only.
    first, second = rng.uniform(-2, 8, 300), rng.uniform(-2, 8, 400)
    plan = rotation_mask(first, second, turn, options)
    met = np.zeros((300, 400), int)
    for rows, columns, _ in plan.blocks:
        met[np.ix_(plan.order1[rows], plan.order2[columns])] += 1
    apart = angle_between(first[:, None] + turn, second[None])
    assert met.max() == 1
    sector_deg = 360 / options.num_sectors
    assert met[apart < np.deg2rad(options.tolerance_deg) - 1e-6].all()
    assert not met[apart > np.deg2rad(options.tolerance_deg + sector_deg) + 1e-6].any()
    assert met.mean() == pytest.approx((sector_deg + 2 * options.tolerance_deg) / 360, rel=0.2)


@pytest.mark.parametrize(("count1", "count2"), [(0, 4), (4, 0), (0, 0)])
def test_photos_without_features_are_fine(count1, count2):
    plan = rotation_mask(np.zeros(count1, np.float32), np.zeros(count2, np.float32), 1.0, DEFAULT)
    assert sum((rows.stop - rows.start) for rows, _, _ in plan.blocks) == count1
    assert all(columns.stop - columns.start == 0 for _, columns, _ in plan.blocks) or count2


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"tolerance_deg": 0.0}, "tolerance_deg must be above 0, got 0.0"),
        ({"tolerance_deg": np.nan}, "tolerance_deg must be above 0, got nan"),
        ({"min_matches": 0}, "min_matches must be at least 1, got 0"),
        ({"min_agreeing": 0.0}, "min_agreeing must be above 0 and at most 1, got 0.0"),
        ({"min_agreeing": 1.1}, "min_agreeing must be above 0 and at most 1, got 1.1"),
        ({"num_sectors": 0}, "num_sectors must be at least 1, got 0"),
        ({"num_sectors": 1}, "a sector of 360 / num_sectors .* below 360 degrees .* got 400"),
        ({"tolerance_deg": 172.5}, "twice tolerance_deg must be below 360 .* got 360"),
    ],
)
def test_values_out_of_range_are_refused_by_name(wrong, message):
    with pytest.raises(ConfigError, match=message):
        RotationOptions(**wrong)
