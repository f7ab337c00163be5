"""Two models that photos between them show to be one are joined by a similarity."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from itertools import combinations

from sfm_front.errors import ConfigError
from sfm_front.events import Emit, ModelsJoined
from sfm_front.mapping.acceptance import AcceptanceOptions, is_sound
from sfm_front.mapping.bridging import BridgingOptions, count_matches, find_bridging
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.mapping.merging import merged, with_cameras_of
from sfm_front.mapping.model import Model
from sfm_front.mapping.point_matches import Side
from sfm_front.mapping.view_graph import ViewGraph


@dataclass(frozen=True, kw_only=True)
class JoiningOptions:
    """When two models are joined."""

    # Photos that a model must have beside those of the larger one it is joined to.
    min_photos: int = 3
    # A join that failed is tried again once there are this many times the bridge photos.
    retry_growth: float = 1.2
    bridging: BridgingOptions = field(default_factory=BridgingOptions)
    acceptance: AcceptanceOptions = field(default_factory=AcceptanceOptions)

    def __post_init__(self) -> None:
        if self.min_photos < 1:
            raise ConfigError(f"min_photos must be at least 1, got {self.min_photos}")
        if self.retry_growth < 1:
            raise ConfigError(f"retry_growth must be at least 1, got {self.retry_growth}")


class Joiner:
    """Joins models over one view graph. A join that failed is not tried again and again."""

    def __init__(
        self,
        view_graph: ViewGraph,
        options: JoiningOptions,
        mapper_options: MapperOptions,
        emit: Emit,
    ) -> None:
        """``emit`` hears of each join."""
        self._view_graph = view_graph
        self._options = options
        self._mapper_options = mapper_options
        self._seed = mapper_options.seed
        self._emit = emit
        self._bridges_at_failure: dict[tuple[int, int], int] = {}

    def forget_failures(self) -> None:
        """Allow every join to be tried again."""
        self._bridges_at_failure.clear()

    def join(self, models: Sequence[Model]) -> list[Model]:
        """The models, all joined that bridge photos show to be one; those given stay as they were.

        A model takes in smaller ones, and keeps its id.
        """
        left = sorted(models, key=lambda model: -model.num_registered)
        bridges = _count_bridges(self._view_graph, [model.registered for model in left])
        for pair in combinations(range(len(left)), 2):
            first, second = (left[number] for number in pair)
            ids = first.model_id, second.model_id
            own = second.registered - first.registered
            if bridges[pair] == 0 or len(own) < self._options.min_photos:
                continue
            if bridges[pair] < self._options.retry_growth * self._bridges_at_failure.get(ids, 0):
                continue
            joined = self._joined(first, second)
            if joined is not None:
                return self.join([joined, *(m for m in left if m not in (first, second))])
            self._bridges_at_failure[ids] = bridges[pair]
        return left

    def _joined(self, first: Model, second: Model) -> Model | None:
        started = time.perf_counter()
        ours, theirs = first.reconstruction, second.reconstruction
        options = self._options.bridging
        sides = Side.all_of(ours), Side.all_of(theirs)
        # Before a model is adjusted in vain.
        if count_matches(self._view_graph, *sides, options, self._seed) < options.min_matches:
            return None
        theirs = with_cameras_of(theirs, ours, self._mapper_options)
        sides = sides[0], Side.all_of(theirs)
        bridging = find_bridging(self._view_graph, *sides, options, self._seed)
        if bridging is None:
            return None
        joined = first.succeeded_by(
            merged(ours, theirs, bridging.first_from_second, bridging.same_points)
        )
        joined.refine_briefly()
        parts = (ours, theirs)
        if not is_sound(joined.reconstruction, parts, bridging.matches, self._options.acceptance):
            return None
        joined.emit = self._emit
        self._emit(
            ModelsJoined(
                first.model_id,
                second.model_id,
                (first.num_registered, second.num_registered),
                bridging.bridges,
                len(bridging.same_points),
                time.perf_counter() - started,
            )
        )
        return joined


def _count_bridges(
    view_graph: ViewGraph, registered: Sequence[Collection[int]]
) -> Counter[tuple[int, int]]:
    """Two models by their numbers → photos that are in both, or have pairs into the one and are in
    the other or in none. Those in the first model alone are not looked at: their pairs are seen
    from the other end."""
    bridges: Counter[tuple[int, int]] = Counter()
    if len(registered) < 2:
        return bridges
    models_of: defaultdict[int, set[int]] = defaultdict(set)
    for number, image_ids in enumerate(registered):
        for image_id in image_ids:
            models_of[image_id].add(number)
    for image_id in view_graph.image_ids:
        mine = models_of.get(image_id, set())
        if mine == {0}:
            continue
        reached = set().union(*(models_of.get(i, ()) for i in view_graph.neighbors(image_id)))
        touched = combinations(sorted(mine | reached), 2)
        bridges.update(pair for pair in touched if not mine or mine.intersection(pair))
    return bridges
