"""Simulated runs take what arithmetic says where it can say it."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers.cluster_reports import measured

from sfm_front.errors import ConfigError
from sfm_front.evaluation.power_law import PowerLaw
from sfm_front.evaluation.scaling.costs import Costs, TaskCost
from sfm_front.evaluation.scaling.simulation import ClusterShape, simulate

FAST_WAY = 1e15
NOTHING = PowerLaw(0.0)


@pytest.fixture
def costs() -> Costs:
    """Of workers alone: a photo takes 0.5 s, 0.25 s and 0.125 s of them, with the overlap. Joins
    cost nothing."""
    free = dict.fromkeys(("retrieve", "store", "cut", "group", "take", "end"), NOTHING)
    return replace(Costs.of([measured(40)]), start_seconds=0.0, join=TaskCost(0, 0), **free)


def shape(num_workers: int, **others: object) -> ClusterShape:
    return ClusterShape(num_workers=num_workers, **{"bytes_per_second": FAST_WAY, **others})


def test_one_worker_does_one_thing_after_another(costs):
    assert simulate(costs, 800, shape(1)).wall_s == pytest.approx(800 * 0.875, rel=1e-3)


def test_more_workers_share_the_work(costs):
    ten = simulate(costs, 8000, shape(10))
    assert ten.wall_s == pytest.approx(800 * 0.875, rel=0.03)
    assert ten.busy > 0.95


def test_fewer_groups_than_workers_leave_some_idle(costs):
    # Forty photos in two groups: two workers grow, and six wait.
    two, eight = (simulate(costs, 40, shape(n)).groups_s for n in (2, 8))
    assert eight == pytest.approx(two)


def test_groups_are_joined_in_rounds_until_two_are_left(costs):
    # Sixteen groups of 20 and their overlap, three rounds that hold all of them.
    joined = replace(costs, join=TaskCost(0.04, 0))
    more_s = simulate(joined, 320, shape(1)).wall_s - simulate(costs, 320, shape(1)).wall_s
    assert more_s == pytest.approx(3 * 320 * 1.25 * 0.04)
    # A join waits for its parts: the last ones are for two workers, whatever there are.
    many = simulate(joined, 320, shape(64))
    assert many.groups_s >= (20 * 0.1 + (40 + 80 + 160) * 0.04) * 1.25


def test_the_coordinator_alone_makes_the_end(costs):
    with_end = replace(costs, end=PowerLaw(0.02, 1.0))
    one, many = (simulate(with_end, 2000, shape(n)) for n in (1, 1000))
    assert one.end_s == many.end_s == pytest.approx(40.0)
    assert many.wall_s > 40


def test_a_slow_coordinator_keeps_workers_waiting(costs):
    # Storing takes a second a photo: no number of workers is faster than that.
    slow = replace(costs, store=PowerLaw(1.0))
    many = simulate(slow, 400, shape(64))
    assert 400 <= many.photos_s <= 420
    assert many.busy < 0.05


def test_a_slow_network_is_the_limit(costs):
    # Three, one and half a megabyte per photo through one way, groups with their overlap.
    megabytes = 3.0 + 1.0 + 0.5 * 1.25
    many = simulate(costs, 2000, shape(64, bytes_per_second=1e6))
    assert many.wall_s == pytest.approx(2000 * megabytes, rel=0.02)


def test_cores_that_workers_share_are_the_limit(costs):
    alone, shared = (simulate(costs, 800, shape(4, num_cores=cores)) for cores in (None, 2))
    assert shared.wall_s == pytest.approx(2 * alone.wall_s, rel=0.02)


def test_what_cannot_be_simulated_is_refused(costs):
    with pytest.raises(ConfigError, match="num_workers"):
        ClusterShape(num_workers=0)
    with pytest.raises(ConfigError, match="num_cores"):
        ClusterShape(num_workers=1, num_cores=0)
    with pytest.raises(ConfigError, match="bytes_per_second"):
        ClusterShape(num_workers=1, bytes_per_second=0)
    with pytest.raises(ConfigError, match="at least one photo"):
        simulate(costs, 0, shape(1))
