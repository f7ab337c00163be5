"""Which pair to start a model from, and what it must satisfy."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from sfm_front.mapping.model import InitialPairConstraints, MapperOptions, Model
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.runtime.stopwatch import Stopwatch

_ANGLE_TOLERANCE = 0.7


@dataclass(frozen=True, kw_only=True)
class ConstraintLevel:
    """What an initial pair must show once this many photos wait.

    ``min_waiting`` of None: asked for only when no more photos will come.
    """

    min_waiting: int | None
    constraints: InitialPairConstraints


@dataclass(frozen=True, kw_only=True)
class InitializationOptions:
    """How hard a start is sought, and how far its constraints are relaxed."""

    # COLMAP's own constraints first, then relaxed: nadir flights need a smaller angle, driving
    # along a street 1° and forward motion.
    constraint_levels: tuple[ConstraintLevel, ...] = (
        ConstraintLevel(
            min_waiting=2, constraints=InitialPairConstraints(min_angle_deg=16, min_inliers=100)
        ),
        ConstraintLevel(
            min_waiting=4, constraints=InitialPairConstraints(min_angle_deg=8, min_inliers=60)
        ),
        ConstraintLevel(
            min_waiting=6,
            constraints=InitialPairConstraints(
                min_angle_deg=4, min_inliers=50, max_forward_motion=1
            ),
        ),
        ConstraintLevel(
            min_waiting=10,
            constraints=InitialPairConstraints(
                min_angle_deg=1, min_inliers=50, max_forward_motion=1
            ),
        ),
        ConstraintLevel(
            min_waiting=None,
            constraints=InitialPairConstraints(
                min_angle_deg=2,
                min_inliers=20,
                max_forward_motion=1,
                min_points=15,
                refine_intrinsics=False,
            ),
        ),
    )
    # Pairs estimated per arriving photo.
    max_trials: int = 4
    # Pairs estimated once no more photos will come.
    max_last_trials: int = 60


class Initializer:
    """Starts models. A pair is tried once per constraint level."""

    def __init__(
        self,
        scene: ViewGraph,
        options: InitializationOptions,
        mapper_options: MapperOptions,
        clock: Stopwatch,
    ) -> None:
        self._view_graph = scene
        self._clock = clock
        self._options = options
        self._mapper_options = mapper_options
        self._tried: set[tuple[int, int, int]] = set()

    def start(self, group: Collection[int], *, last_call: bool = False) -> tuple[Model, str] | None:
        """A model of two photos of the group, the strictest constraints and strongest pairs first.

        On the last call no more photos will come, and few may be asked for as little as many.
        Returns the model with a line on how it began, or None when the trials are used up.
        """
        trials = self._options.max_last_trials if last_call else self._options.max_trials
        for level, relaxation in enumerate(self._options.constraint_levels):
            if not last_call and not _allowed(relaxation, len(group)):
                break
            demanded_deg = relaxation.constraints.min_angle_deg
            for pair in self._view_graph.pairs(group):
                if (*pair, level) in self._tried:
                    continue
                # Known from verification, with the focal length's error in it, or not at all.
                angle_deg = self._view_graph.angle_deg(pair)
                if angle_deg is not None and angle_deg < _ANGLE_TOLERANCE * demanded_deg:
                    continue
                if trials == 0:
                    return None
                self._tried.add((*pair, level))
                trials -= 1
                model = Model(self._view_graph, self._mapper_options, self._clock)
                if model.initialize(*pair, relaxation.constraints):
                    return model, _describe(pair, relaxation.constraints)
        return None

    def best_starts(self, per_relaxation: int) -> Iterator[tuple[Model, str]]:
        """Models of two photos from the pairs that COLMAP finds best in the whole scene."""
        for relaxation in self._options.constraint_levels:
            if relaxation.min_waiting is None:
                break
            finder = Model(self._view_graph, self._mapper_options, self._clock)
            for _ in range(per_relaxation):
                pair = finder.find_initial_pair(relaxation.constraints)
                if pair is None:
                    break
                model = Model(self._view_graph, self._mapper_options, self._clock)
                if model.initialize(*pair, relaxation.constraints):
                    yield model, _describe(pair, relaxation.constraints)


def _allowed(relaxation: ConstraintLevel, num_waiting: int) -> bool:
    return relaxation.min_waiting is not None and num_waiting >= relaxation.min_waiting


def _describe(pair: tuple[int, int], constraints: InitialPairConstraints) -> str:
    return (
        f"model started from images {pair[0]} and {pair[1]}, "
        f"demanding {constraints.min_angle_deg:g} degrees and {constraints.min_inliers} inliers"
    )
