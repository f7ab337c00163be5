"""When a model is refined as a whole, and what that costs over a long session."""

from __future__ import annotations

from itertools import pairwise

import pytest

from sfm_front.errors import ConfigError
from sfm_front.mapping.refinement_schedule import (
    RefinementSchedule,
    ScheduleOptions,
)


def refinements(
    num_images: int,
    *,
    growth: float,
    large_growth: float | None = None,
    points_per_image: int = 200,
) -> list[int]:
    """The sizes at which a model that grows photo by photo is refined, from 2 photos on."""
    options = ScheduleOptions(growth=growth, large_growth=large_growth or growth)
    schedule = RefinementSchedule(options)
    schedule.refined(2, 2 * points_per_image)
    sizes = []
    for size in range(3, num_images + 1):
        if schedule.is_due(size, size * points_per_image):
            schedule.refined(size, size * points_per_image)
            sizes.append(size)
    return sizes


@pytest.mark.parametrize("growth", [1.1, 1.25, 2.0])
def test_all_refinements_together_cost_a_fixed_number_of_the_last(growth):
    """Sizes grow geometrically: their sum is below that of the series, growth / (growth - 1)."""
    for num_images in (50, 500, 5000):
        sizes = refinements(num_images, growth=growth)
        assert sum(sizes) <= sizes[-1] * growth / (growth - 1)


def test_the_cost_a_photo_does_not_grow():
    cost = [sum(refinements(n, growth=1.25)) / n for n in (100, 1000, 10_000)]
    assert max(cost) < 1.25 * min(cost) + 1


def test_a_small_model_is_refined_often_and_a_large_one_seldom():
    sizes = refinements(1000, growth=1.25)
    assert sizes[:3] == [3, 4, 5]
    assert len([size for size in sizes if size > 500]) <= 4


def test_no_model_waits_longer_than_its_growth_allows():
    sizes = [2, *refinements(1000, growth=1.25)]
    for earlier, later in pairwise(sizes):
        assert later < 1.25 * earlier + 1


def test_a_large_model_may_grow_further():
    sizes = refinements(2000, growth=1.25, large_growth=1.6)
    growths = [(earlier, later / earlier) for earlier, later in pairwise(sizes)]
    assert {growth < 1.3 for size, growth in growths if 20 <= size < 100} == {True}
    assert {1.6 <= growth < 1.61 for size, growth in growths if size >= 100} == {True}


def test_growth_in_points_alone_is_enough():
    schedule = RefinementSchedule(ScheduleOptions(growth=1.5))
    schedule.refined(90, 1000)
    assert not schedule.is_due(91, 1499)
    assert schedule.is_due(91, 1500)
    assert schedule.is_due(135, 1001)


@pytest.mark.parametrize("name", ["growth", "large_growth"])
def test_without_growth_there_is_no_schedule(name):
    with pytest.raises(ConfigError, match=f"{name} must be above 1, got 1"):
        ScheduleOptions(**{name: 1.0})
