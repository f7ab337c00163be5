"""How two sides lie to each other, if enough photos between them agree on it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.mapping.point_matches import PointMatches, Side, match_points
from sfm_front.mapping.similarity_estimation import SimilarityOptions, estimate_similarity
from sfm_front.mapping.view_graph import ViewGraph


@dataclass(frozen=True, kw_only=True)
class BridgingOptions:
    """When the photos between two sides are believed."""

    # Points of either side that agree on how they lie to each other: as many as ORB-SLAM3 asks for.
    min_matches: int = 20
    # Matches from which a bridge photo has a say, the share of them by which it agrees, and the
    # share of such photos that must: one never decides against another. Sound models agree nearly
    # everywhere; a bent one agrees with another here and there.
    min_bridge_matches: int = 8
    min_share: float = 0.7
    min_agreeing: float = 0.75
    # Matches used per bridge photo.
    sample: int = 200
    similarity: SimilarityOptions = field(default_factory=SimilarityOptions)

    def __post_init__(self) -> None:
        for name in ("min_matches", "min_bridge_matches", "sample"):
            if getattr(self, name) < 3:
                raise ConfigError(f"{name} must be at least 3, got {getattr(self, name)}")
        for name in ("min_share", "min_agreeing"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"{name} must be from 0 to 1, got {getattr(self, name)}")


@dataclass(frozen=True, slots=True, eq=False)
class Bridging:
    """``matches``: those that agree with the similarity ``first_from_second``."""

    first_from_second: pycolmap.Sim3d
    matches: PointMatches

    @property
    def bridges(self) -> tuple[int, ...]:
        """Image ids of the photos that it rests on."""
        return tuple(np.unique(self.matches.bridges).tolist())

    @property
    def same_points(self) -> list[tuple[int, int]]:
        """A point of either side that are one."""
        return [(one, other) for one, other in np.unique(self.matches.ids, axis=0).tolist()]


def count_matches(
    view_graph: ViewGraph, first: Side, second: Side, options: BridgingOptions, seed: int
) -> int:
    """Matches that ``find_bridging`` would go by."""
    return len(match_points(view_graph, first, second, sample=options.sample, seed=seed))


def find_bridging(
    view_graph: ViewGraph, first: Side, second: Side, options: BridgingOptions, seed: int
) -> Bridging | None:
    """None if too few points are matched, or the photos between the sides do not agree."""
    matches = match_points(view_graph, first, second, sample=options.sample, seed=seed)
    if len(matches) < options.min_matches:
        return None
    similarity, fits = estimate_similarity(matches, options.similarity, seed)
    if not _is_agreed(matches, fits, options):
        return None
    return Bridging(similarity.only(), matches.some(np.flatnonzero(fits)))


def _is_agreed(matches: PointMatches, fits: NDArray[np.bool_], options: BridgingOptions) -> bool:
    if len(np.unique(matches.ids[fits], axis=0)) < options.min_matches:
        return False
    agreeing = [
        fits[mine].mean() >= options.min_share
        for bridge in np.unique(matches.bridges)
        for mine in [matches.bridges == bridge]
        if mine.sum() >= options.min_bridge_matches
    ]
    return bool(agreeing) and bool(np.mean(agreeing) >= options.min_agreeing)
