"""The view graph cut into groups of photos that overlap, each for one worker."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence

from sfm_front.mapping.view_graph import ViewGraph

# A smaller one cannot be a model.
_SMALLEST = 3
# Up to this many times the workers, groups are made a multiple of them: none of them is to wait
# for the last one.
_FEW_ROUNDS = 3


def cut(
    graph: ViewGraph,
    photos: Collection[int],
    *,
    group_size: int,
    overlap: float,
    num_workers: int,
) -> list[list[int]]:
    """Groups of these photos' image ids, each in order of arrival, the largest first.

    Photos that no chain of pairs links are not in one group. A group has ``group_size`` photos at
    most, and ``overlap`` times as many more of those that its own have most inliers with, be they
    in ``photos`` or not.
    """
    groups: list[set[int]] = []
    for component in _components(graph, set(photos)):
        number = num_parts(len(component), group_size, num_workers)
        groups += _parts(graph, sorted(component), number)
    widened = [sorted(group | _beside(graph, group, overlap)) for group in groups]
    return sorted(widened, key=lambda group: (-len(group), group))


def _components(graph: ViewGraph, photos: set[int]) -> list[set[int]]:
    left, found = set(photos), []
    while left:
        component = graph.component([min(left)], among=photos)
        left -= component
        if len(component) >= _SMALLEST:
            found.append(component)
    return found


def num_parts(num_photos: int, group_size: int, num_workers: int) -> int:
    """Groups that so many linked photos are cut into."""
    number = -(-num_photos // group_size)
    if 1 < number < _FEW_ROUNDS * num_workers:
        even = -(-number // num_workers) * num_workers
        if 2 * num_photos >= even * group_size:
            return even
    return number


def _parts(graph: ViewGraph, photos: Sequence[int], number: int) -> list[set[int]]:
    if number == 1:
        return [set(photos)]
    import pymetis

    place = {image_id: index for index, image_id in enumerate(photos)}
    offsets, neighbors, weights = [0], [], []
    for image_id in photos:
        for other, inliers in graph.neighbors(image_id).items():
            if other in place:
                neighbors.append(place[other])
                weights.append(inliers)
        offsets.append(len(neighbors))
    _, part_of = pymetis.part_graph(
        number,
        pymetis.CSRAdjacency(offsets, neighbors),
        eweights=weights,
        options=pymetis.Options(seed=0, contig=True),
        recursive=False,
    )
    parts: defaultdict[int, set[int]] = defaultdict(set)
    for image_id, part in zip(photos, part_of, strict=True):
        parts[part].add(image_id)
    return list(parts.values())


def _beside(graph: ViewGraph, group: set[int], overlap: float) -> set[int]:
    """Photos outside that it has most inliers with."""
    inliers: defaultdict[int, int] = defaultdict(int)
    for image_id in group:
        for other, count in graph.neighbors(image_id).items():
            if other not in group:
                inliers[other] += count
    nearest = sorted(inliers, key=lambda other: (-inliers[other], other))
    return set(nearest[: round(overlap * len(group))])
