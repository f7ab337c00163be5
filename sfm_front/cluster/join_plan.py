"""Which groups are joined with which, two at a time, before the coordinator joins what is left."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from sfm_front.mapping.view_graph import ViewGraph

# So many are left to the coordinator, which has the whole to adjust anyway.
LEFT = 2


@dataclass(frozen=True, slots=True)
class Node:
    """A group, or the union of two nodes by their numbers; ``photos`` in order of arrival."""

    photos: tuple[int, ...]
    parts: tuple[int, int] | None = None


def plan_joins(graph: ViewGraph, groups: Sequence[Sequence[int]]) -> list[Node]:
    """The groups, and after them the unions, each after its parts: in rounds of pairs, those with
    most inliers between them first, so that no model is adjusted more often than there are
    rounds."""
    nodes = [Node(tuple(group)) for group in groups]
    links = _links(graph, groups)
    active = set(range(len(nodes)))
    while len(active) > LEFT:
        free = set(active)
        made: list[tuple[int, int]] = []
        for (first, second), _ in sorted(links.items(), key=lambda link: (-link[1], link[0])):
            if len(active) - len(made) <= LEFT:
                break
            if first in free and second in free:
                free -= {first, second}
                made.append((first, second))
        if not made:
            break
        for first, second in made:
            photos = sorted({*nodes[first].photos, *nodes[second].photos})
            nodes.append(Node(tuple(photos), (first, second)))
            active = active - {first, second} | {len(nodes) - 1}
        links = _between(links, nodes, active)
    return nodes


def _links(graph: ViewGraph, groups: Sequence[Sequence[int]]) -> Counter[tuple[int, int]]:
    """Two groups by their numbers → inliers of the pairs between them."""
    groups_of: defaultdict[int, list[int]] = defaultdict(list)
    for number, group in enumerate(groups):
        for image_id in group:
            groups_of[image_id].append(number)
    links: Counter[tuple[int, int]] = Counter()
    for image_id, mine in groups_of.items():
        for other, inliers in graph.neighbors(image_id).items():
            for first in mine:
                for second in groups_of.get(other, ()):
                    if first < second:
                        links[first, second] += inliers
    return links


def _between(
    links: Counter[tuple[int, int]], nodes: Sequence[Node], active: set[int]
) -> Counter[tuple[int, int]]:
    """The same of the nodes that are left."""
    now: dict[int, int] = {number: number for number in active}
    for number in active:
        for part in nodes[number].parts or ():
            now[part] = number
    found: Counter[tuple[int, int]] = Counter()
    for (first, second), inliers in links.items():
        one, other = sorted((now[first], now[second]))
        if one != other:
            found[one, other] += inliers
    return found
