"""View graphs are cut into groups that overlap."""

from __future__ import annotations

import pytest
from helpers.view_graphs import graph_of, line

from sfm_front.cluster.groups import cut


@pytest.mark.parametrize("num_workers", [1, 2, 8])
def test_groups_hold_all_photos_and_overlap(num_workers: int) -> None:
    groups = cut(
        graph_of(100, line(1, 100)),
        range(1, 101),
        group_size=25,
        overlap=0.2,
        num_workers=num_workers,
    )
    assert set().union(*groups) == set(range(1, 101))
    assert max(map(len, groups)) <= 1.2 * 25 * 1.1  # METIS balances within some percent
    for group in groups:
        others = set().union(*(other for other in groups if other is not group))
        assert set(group) & others
        assert group == sorted(group)


def test_no_worker_waits_for_the_last_group() -> None:
    graph, photos = graph_of(70, line(1, 70)), range(1, 71)
    for num_workers, expected in ((1, 3), (2, 4), (4, 4)):
        groups = cut(graph, photos, group_size=30, overlap=0, num_workers=num_workers)
        assert len(groups) == expected


def test_what_no_pair_links_is_not_in_one_group_and_loose_photos_in_none() -> None:
    pairs = [*line(1, 10), *line(11, 20), (22, 21)]
    groups = cut(graph_of(23, pairs), range(1, 24), group_size=30, overlap=0.2, num_workers=2)
    assert groups == [list(range(1, 11)), list(range(11, 21))]


def test_photos_of_a_model_are_in_a_group_as_neighbours_only() -> None:
    groups = cut(
        graph_of(30, line(1, 30)), range(21, 31), group_size=30, overlap=0.2, num_workers=2
    )
    assert groups == [[*range(19, 31)]]


def test_the_same_graph_is_cut_in_the_same_way() -> None:
    first, second = (
        cut(graph_of(90, line(1, 90)), range(1, 91), group_size=20, overlap=0.2, num_workers=2)
        for _ in range(2)
    )
    assert first == second
