"""Groups are joined in rounds, with their neighbours first, until two are left."""

from __future__ import annotations

from helpers.view_graphs import graph_of, line

from sfm_front.cluster.join_plan import Node, plan_joins


def flight(num_groups: int) -> list[list[int]]:
    """Groups of ten along a line, each with the first two photos of the next one."""
    last = 10 * num_groups
    return [[*range(i, min(i + 12, last + 1))] for i in range(1, last, 10)]


def test_rounds_of_neighbours() -> None:
    groups = flight(8)
    nodes = plan_joins(graph_of(80, line(1, 80)), groups)
    assert nodes[:8] == [Node(tuple(group)) for group in groups]
    joins = nodes[8:]
    # Eight become four and four become two, which the coordinator joins.
    assert len(joins) == 6
    parts = [part for node in joins for part in node.parts or ()]
    assert sorted(parts) == list(range(12))
    for node in joins:
        # Neighbours: without a gap.
        assert list(node.photos) == list(range(node.photos[0], node.photos[-1] + 1))


def test_an_odd_one_waits_for_the_next_round() -> None:
    nodes = plan_joins(graph_of(50, line(1, 50)), flight(5))
    assert len(nodes) - 5 == 3
    assert max(len(node.photos) for node in nodes) < 50


def test_two_are_left_to_the_coordinator_and_strangers_are_not_joined() -> None:
    assert len(plan_joins(graph_of(20, line(1, 20)), flight(2))) == 2
    apart = [pair for start in (1, 11, 21) for pair in line(start, start + 9)]
    groups = [[*range(start, start + 10)] for start in (1, 11, 21)]
    assert len(plan_joins(graph_of(30, apart), groups)) == 3
