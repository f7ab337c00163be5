"""The end of a session: what the stream could not place, and the last refinement of all models."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Protocol

from sfm_front.events import (
    DropReason,
    FinishingStep,
    ModelTurn,
    RegisteredStructureLess,
    StartKind,
)
from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.initialization import Initializer
from sfm_front.mapping.model import Model
from sfm_front.mapping.restart import Restart
from sfm_front.mapping.unfolding import unfold


class OnStep(Protocol):
    """Hears that a step begins, or the turn of a model in it."""

    def __call__(self, step: FinishingStep, turn: ModelTurn | None = None, /) -> None: ...


def finish(
    atlas: Atlas,
    restart: Restart | None = None,
    before_last: Callable[[], None] = lambda: None,
    on_step: OnStep = lambda _step, _turn=None: None,
) -> None:
    """Retry what waits, restart where the stream began badly, refine everything.

    ``restart``: the one that may be under way. ``before_last`` is called before the last adjustment
    of the models, ``on_step`` with each step when it begins, in the last adjustment with each model
    when that is taken up. They cannot grow any more after this.
    """
    _Finishing(atlas, restart or Restart(atlas), before_last, on_step).run()


def place_all(atlas: Atlas) -> None:
    """The first part of it alone: all that waits and can be placed has a place then. The models
    can grow on."""
    _Finishing(atlas, Restart(atlas), lambda: None, lambda _step, _turn=None: None).place_all()


class _Finishing:
    def __init__(
        self,
        atlas: Atlas,
        restart: Restart,
        before_last: Callable[[], None],
        on_step: OnStep,
    ) -> None:
        self._atlas = atlas
        self._before_last = before_last
        self._on_step = on_step
        self._view_graph = atlas.view_graph
        self._options = atlas.options
        self._initializer = atlas.initializer
        self._restart = restart

    def run(self) -> None:
        self.place_all()
        if unfold(self._atlas):
            self._start_remaining()
        self._fix_intrinsics()
        self._drop_small()
        self._register_loose()
        if self._restart.misses_photos():
            for model in self._atlas.models:
                model.take_two_view_tracks()
            self._atlas.refine_until_stable()
            self._register_loose()
        for model in self._atlas.models:
            model.leave_refinement()
        self._before_last()
        models = self._atlas.models
        for number, model in enumerate(models, start=1):
            turn = ModelTurn(model.model_id, number, len(models), model.num_registered)
            self._on_step(FinishingStep.LAST_ADJUSTMENT, turn)
            model.finish()
        self._drop_without_pairs()
        self._atlas.drop_covered()

    def place_all(self) -> None:
        self._on_step(FinishingStep.REFINE)
        self._atlas.refine_until_stable()
        self._on_step(FinishingStep.START_AFRESH)
        while self._restart.go_on():
            pass
        self._start_remaining()

    def _fix_intrinsics(self) -> None:
        """Grow models anew whose photos do not tell what their camera is, with what EXIF says.

        A nadir flight over flat ground does not determine focal length and distortion
        (TUNING: fixed-intrinsics).
        """
        miscalibrated = [model for model in self._atlas.models if model.is_miscalibrated]
        held = replace(self._options.mapper, refine_intrinsics=False)
        initializer = self._initializer.with_options(held)
        for model in miscalibrated:
            fresh = self._best_start(model.registered, initializer, StartKind.FIXED_INTRINSICS)
            if fresh is None:
                continue
            if fresh.num_registered < self._options.min_share * model.num_registered:
                self._atlas.announce_drop(fresh, DropReason.NO_BETTER)
                continue
            self._atlas.models[self._atlas.models.index(model)] = fresh
            self._atlas.announce_drop(model, DropReason.REPLACED)
        if miscalibrated:
            self._atlas.refine_until_stable()

    def _start_remaining(self) -> None:
        """Further models from photos that are linked to each other and fit nowhere."""
        seen: set[int] = set()
        for image_id in self._atlas.waiting:
            if image_id in seen or image_id in self._atlas.registered:
                continue
            group = self._view_graph.component([image_id], among=set(self._atlas.waiting))
            seen |= group
            if len(group) < self._options.min_model_size:
                continue
            model = self._best_start(group, self._initializer, StartKind.LAST_CALL)
            if model is not None:
                self._atlas.models.append(model)
                self._atlas.refine_until_stable()

    def _best_start(
        self, group: Collection[int], initializer: Initializer, kind: StartKind
    ) -> Model | None:
        """Of the models that start within a group, the first to hold most of it, or the largest."""
        best: Model | None = None
        while (model := initializer.start(group, kind, last_call=True)) is not None:
            model.grow(group)
            worse: Model | None = model
            if best is None or _size(model) > _size(best):
                best, worse = model, best
            if worse is not None:
                self._atlas.announce_drop(worse, DropReason.NO_BETTER)
            if model.num_registered >= self._options.min_share * len(group):
                break
        return best

    def _register_loose(self) -> None:
        while self._register_structure_less():
            self._atlas.refine_until_stable()

    def _register_structure_less(self) -> bool:
        """Register photos that see too few points by two-view geometry; True if any was."""
        any_placed = False
        for model in self._atlas.models:
            placed = model.register_structure_less(self._atlas.candidates_of(model))
            if placed:
                any_placed = True
                self._atlas.emit(RegisteredStructureLess(model.model_id, tuple(placed)))
        return any_placed

    def _drop_small(self) -> None:
        covered: set[int] = set()
        kept: list[Model] = []
        for model in self._atlas.models:
            own = model.registered - covered
            if not kept or len(own) >= self._options.min_model_size:
                kept.append(model)
                covered |= own
            else:
                self._atlas.announce_drop(model, DropReason.TOO_SMALL)
        self._atlas.models = kept

    def _drop_without_pairs(self) -> None:
        """Drop models of which the last refinement left a single photo, or none."""
        for model in list(self._atlas.models):
            if model.num_registered < 2:
                self._atlas.models.remove(model)
                self._atlas.announce_drop(model, DropReason.TOO_SMALL)


def _size(model: Model) -> tuple[int, int]:
    return model.num_registered, model.num_points
