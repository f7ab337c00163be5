"""Two models that photos between them show to be one are joined by a similarity."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.events import Emit, ModelsJoined
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.mapping.merging import merged, with_cameras_of
from sfm_front.mapping.model import Model
from sfm_front.mapping.point_matches import PointMatches, Side, match_points
from sfm_front.mapping.similarity_estimation import SimilarityOptions, estimate_similarity
from sfm_front.mapping.view_graph import ViewGraph


@dataclass(frozen=True, kw_only=True)
class JoiningOptions:
    """When two models are joined."""

    # Photos that a model must have beside those of the larger one it is joined to.
    min_photos: int = 3
    # Common points that must agree on how the models lie to each other.
    min_matches: int = 20
    # Matches from which a bridge photo has a say, the share of them by which it agrees, and the
    # share of such photos that must: one never decides against another.
    min_bridge_matches: int = 8
    min_share: float = 0.5
    min_agreeing: float = 0.6
    # Share of the observations of either model, and of the common points, that must be left when
    # the joined model has been refined.
    min_kept: float = 0.9
    min_common: float = 0.5
    # A join that failed is tried again once there are this many times the bridge photos.
    retry_growth: float = 1.2
    # Matches used per bridge photo.
    sample: int = 200
    similarity: SimilarityOptions = field(default_factory=SimilarityOptions)

    def __post_init__(self) -> None:
        for name in ("min_photos", "min_matches", "min_bridge_matches", "sample"):
            if getattr(self, name) < 3:
                raise ConfigError(f"{name} must be at least 3, got {getattr(self, name)}")
        for name in ("min_share", "min_agreeing", "min_kept", "min_common"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"{name} must be from 0 to 1, got {getattr(self, name)}")
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
        if len(self._match(ours, theirs)) < self._options.min_matches:
            return None
        theirs = with_cameras_of(theirs, ours, self._mapper_options)
        matches = self._match(ours, theirs)
        if len(matches) < self._options.min_matches:
            return None
        similarity, fits = estimate_similarity(
            matches, self._options.similarity, self._mapper_options.seed
        )
        inliers = matches.some(np.flatnonzero(fits))
        if not self._is_agreed(matches, fits):
            return None
        reconstruction = merged(ours, theirs, similarity.only(), inliers.ids.tolist())
        joined = first.succeeded_by(reconstruction)
        joined.refine_briefly()
        if not self._is_sound(joined.reconstruction, ours, theirs, inliers):
            return None
        joined.emit = self._emit
        self._emit(
            ModelsJoined(
                first.model_id,
                second.model_id,
                (first.num_registered, second.num_registered),
                tuple(np.unique(inliers.bridges).tolist()),
                len(np.unique(inliers.ids, axis=0)),
                time.perf_counter() - started,
            )
        )
        return joined

    def _match(
        self, ours: pycolmap.Reconstruction, theirs: pycolmap.Reconstruction
    ) -> PointMatches:
        sides = (Side(model, model.reg_image_ids()) for model in (ours, theirs))
        return match_points(
            self._view_graph, *sides, sample=self._options.sample, seed=self._mapper_options.seed
        )

    def _is_agreed(self, matches: PointMatches, fits: NDArray[np.bool_]) -> bool:
        """Whether enough matches agree, and most of the bridge photos that have a say."""
        options = self._options
        if len(np.unique(matches.ids[fits], axis=0)) < options.min_matches:
            return False
        agreeing = [
            fits[mine].mean() >= options.min_share
            for bridge in np.unique(matches.bridges)
            for mine in [matches.bridges == bridge]
            if mine.sum() >= options.min_bridge_matches
        ]
        return bool(agreeing) and bool(np.mean(agreeing) >= options.min_agreeing)

    def _is_sound(
        self,
        joined: pycolmap.Reconstruction,
        ours: pycolmap.Reconstruction,
        theirs: pycolmap.Reconstruction,
        common: PointMatches,
    ) -> bool:
        """Whether refinement left the joined model what both had, and what they have in common."""
        for model in (ours, theirs):
            image_ids = model.reg_image_ids()
            if not all(joined.image(i).has_pose for i in image_ids):
                return False
            kept = _num_observations(joined, image_ids) / _num_observations(model, image_ids)
            if kept < self._options.min_kept:
                return False
        points = [
            [_point_at(joined, *keypoint) for keypoint in of_side]
            for of_side in common.keypoints.tolist()
        ]
        same = [one is not None and one == other for one, other in zip(*points, strict=True)]
        return bool(np.mean(same) >= self._options.min_common)


def _count_bridges(
    view_graph: ViewGraph, registered: Sequence[Collection[int]]
) -> Counter[tuple[int, int]]:
    """Two models by their numbers → photos that are in both, or have pairs into the one and are in
    the other or in none. Those in the first model alone are not looked at: their pairs are seen
    from the other end."""
    models_of: defaultdict[int, set[int]] = defaultdict(set)
    for number, image_ids in enumerate(registered):
        for image_id in image_ids:
            models_of[image_id].add(number)
    bridges: Counter[tuple[int, int]] = Counter()
    if len(registered) < 2:
        return bridges
    for image_id in view_graph.image_ids:
        mine = models_of.get(image_id, set())
        if mine == {0}:
            continue
        reached = set().union(*(models_of.get(i, ()) for i in view_graph.neighbors(image_id)))
        touched = combinations(sorted(mine | reached), 2)
        bridges.update(pair for pair in touched if not mine or mine.intersection(pair))
    return bridges


def _num_observations(model: pycolmap.Reconstruction, image_ids: Iterable[int]) -> int:
    return sum(int(model.image(image_id).num_points3D) for image_id in image_ids)


def _point_at(model: pycolmap.Reconstruction, image_id: int, index: int) -> int | None:
    point = model.image(image_id).point2D(index)
    return int(point.point3D_id) if point.has_point3D() else None
