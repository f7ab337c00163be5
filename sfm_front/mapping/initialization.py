"""Which pair to start a model from, and what it must satisfy."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import count

from sfm_front.errors import ConfigError
from sfm_front.events import Emit, ModelStarted, StartKind
from sfm_front.mapping.background_refinement import BackgroundAdjuster
from sfm_front.mapping.mapper_options import InitialPairConstraints, MapperOptions
from sfm_front.mapping.model import Model
from sfm_front.mapping.view_graph import ViewGraph


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
    # Share of the angle asked for that a pair's own two-view geometry must show to be estimated
    # anew: its focal length is a guess.
    angle_tolerance: float = 0.7

    def __post_init__(self) -> None:
        if not 0 <= self.angle_tolerance <= 1:
            raise ConfigError(f"angle_tolerance must be from 0 to 1, got {self.angle_tolerance}")
        for name in ("max_trials", "max_last_trials"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be at least 1, got {getattr(self, name)}")


class Initializer:
    """Starts models. A pair is tried once per constraint level."""

    def __init__(
        self,
        view_graph: ViewGraph,
        options: InitializationOptions,
        mapper_options: MapperOptions,
        emit: Emit,
        *,
        adjuster: BackgroundAdjuster | None = None,
        model_ids: Iterator[int] | None = None,
    ) -> None:
        """``emit`` hears of each model that is started, and of its refinements, which the
        ``adjuster`` does in the background."""
        self._view_graph = view_graph
        self._options = options
        self._mapper_options = mapper_options
        self._emit = emit
        self._adjuster = adjuster
        self._model_ids = model_ids or count(1)
        self._tried: set[tuple[int, int, int]] = set()

    def with_options(self, mapper_options: MapperOptions) -> Initializer:
        """Another one that has tried nothing yet; it goes on with the same model ids."""
        return Initializer(
            self._view_graph,
            self._options,
            mapper_options,
            self._emit,
            adjuster=self._adjuster,
            model_ids=self._model_ids,
        )

    def next_id(self) -> int:
        """For a model that is made in another way."""
        return next(self._model_ids)

    def go_on_after(self, model_id: int) -> None:
        """Give the next model an id after this one."""
        self._model_ids = count(model_id + 1)

    def start(
        self, group: Collection[int], kind: StartKind, *, last_call: bool = False
    ) -> Model | None:
        """A model of two photos of the group, the strictest constraints and strongest pairs first.

        On the last call no more photos will come, and few may be asked for as little as many.
        None when the trials are used up.
        """
        options = self._options
        trials = options.max_last_trials if last_call else options.max_trials
        for number, level in enumerate(options.constraint_levels):
            if not last_call and not _allowed(level, len(group)):
                break
            for pair in self._view_graph.pairs(group):
                if (*pair, number) in self._tried:
                    continue
                if self._is_hopeless(pair, level):
                    continue
                if trials == 0:
                    return None
                self._tried.add((*pair, number))
                trials -= 1
                model = self._start_from(pair, level.constraints, kind)
                if model is not None:
                    return model
        return None

    def best_starts(self, per_level: int) -> Iterator[Model]:
        """Models of two photos from the pairs that COLMAP finds best in the whole view graph.

        A pair begins one model at most.
        """
        tried: set[tuple[int, int]] = set()
        for level in self._options.constraint_levels:
            if level.min_waiting is None:
                break
            pairs = self._view_graph.pairs(self._view_graph.image_ids)
            if all(self._is_hopeless(pair, level) for pair in pairs):
                continue  # COLMAP would estimate every one of them to find none.
            finder = Model(self._view_graph, self._mapper_options)
            num_new = 0
            while num_new < per_level:
                pair = finder.find_initial_pair(level.constraints)
                if pair is None:
                    break
                if pair in tried:
                    continue
                tried.add(pair)
                num_new += 1
                model = self._start_from(pair, level.constraints, StartKind.RESTART)
                if model is not None:
                    yield model

    def _is_hopeless(self, pair: tuple[int, int], level: ConstraintLevel) -> bool:
        """Whether a pair has fewer matches than the level asks for inliers, or an angle, if known
        from verification, that is far below what it asks for.

        The angle has the error of the focal length in it.
        """
        if self._view_graph.num_matches(pair) < level.constraints.min_inliers:
            return True
        angle_deg = self._view_graph.angle_deg(pair)
        least_deg = self._options.angle_tolerance * level.constraints.min_angle_deg
        return angle_deg is not None and angle_deg < least_deg

    def _start_from(
        self, pair: tuple[int, int], constraints: InitialPairConstraints, kind: StartKind
    ) -> Model | None:
        model = Model(
            self._view_graph, self._mapper_options, emit=self._emit, adjuster=self._adjuster
        )
        if not model.initialize(*pair, constraints):
            return None
        model.model_id = self.next_id()
        self._emit(
            ModelStarted(
                model.model_id, pair, constraints.min_angle_deg, constraints.min_inliers, kind
            )
        )
        return model


def _allowed(level: ConstraintLevel, num_waiting: int) -> bool:
    return level.min_waiting is not None and num_waiting >= level.min_waiting
