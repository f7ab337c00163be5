"""The end of a session: what the stream could not place, and the last refinement of all models."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.initialization import Initializer
from sfm_front.mapping.model import Model


def finish(atlas: Atlas) -> None:
    """Retry what waits, restart where the stream began badly, refine everything.

    The models of the atlas cannot grow any more after this.
    """
    _Finishing(atlas).run()


class _Finishing:
    def __init__(self, atlas: Atlas) -> None:
        self._atlas = atlas
        self._view_graph = atlas.view_graph
        self._options = atlas.options
        self._initializer = atlas.initializer
        self._clock = atlas.clock

    def run(self) -> None:
        self._refine_until_stable()
        self._restart_largest()
        self._start_remaining()
        self._fix_intrinsics()
        self._drop_small()
        while self._register_structure_less():
            self._refine_until_stable()
        for model in self._atlas.models:
            model.finish()
        self._atlas.models = [model for model in self._atlas.models if model.num_registered > 1]
        self._atlas.drop_covered()

    def _refine_until_stable(self) -> None:
        """Refine and grow in turn until nothing more registers."""
        for model in self._atlas.models:
            model.forget_failures()
        while self._atlas.grow():
            for model in self._atlas.models:
                model.refine()
                model.forget_failures()

    def _restart_largest(self) -> None:
        """If the largest model misses photos linked to it, restart it.

        The stream had to take the first acceptable pair; the whole graph offers better ones. The
        better of old and new stays.
        """
        failures = 0
        for fresh, event in self._initializer.best_starts(self._options.fresh_starts):
            largest = self._atlas.models[0] if self._atlas.models else None
            if largest is not None and not self._misses(largest):
                return
            fresh.grow(self._view_graph.image_ids)
            if largest is None or fresh.num_registered > largest.num_registered:
                self._atlas.note(f"grown afresh: {event}")
                self._atlas.models.insert(0, fresh)
                self._refine_until_stable()
            elif 2 * fresh.num_registered > largest.num_registered:
                # It grew far and still registered no more: another start hardly will.
                failures += 1
                if failures == self._options.max_failures:
                    return

    def _fix_intrinsics(self) -> None:
        """Grow models anew whose photos do not tell what their camera is, with what EXIF says.

        A nadir flight over flat ground does not determine focal length and distortion
        (TUNING: fixed-intrinsics).
        """
        miscalibrated = [model for model in self._atlas.models if model.is_miscalibrated]
        held = replace(self._options.mapper, refine_intrinsics=False)
        initializer = Initializer(self._view_graph, self._options.initialization, held, self._clock)
        for model in miscalibrated:
            best = self._best_start(model.registered, initializer)
            if best is None:
                continue
            fresh, event = best
            if fresh.num_registered >= self._options.min_share * model.num_registered:
                self._atlas.note(f"grown afresh, the camera held as EXIF has it: {event}")
                self._atlas.models[self._atlas.models.index(model)] = fresh
        if miscalibrated:
            self._refine_until_stable()

    def _misses(self, model: Model) -> bool:
        """Whether photos linked to a model are in none, or too many in others."""
        linked = self._view_graph.component(model.registered)
        if len(linked - self._atlas.registered) > self._options.max_missed_share * len(linked):
            return True
        return model.num_registered < self._options.min_share * len(linked)

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
            best = self._best_start(group, self._initializer)
            if best is not None:
                model, event = best
                self._atlas.note(event)
                self._atlas.models.append(model)
                self._refine_until_stable()

    def _best_start(
        self, group: Collection[int], initializer: Initializer
    ) -> tuple[Model, str] | None:
        """Of the models that start within a group, the first to hold most of it, or the largest."""
        best: tuple[Model, str] | None = None
        while (started := initializer.start(group, last_call=True)) is not None:
            model, _ = started
            model.grow(group)
            if best is None or _size(model) > _size(best[0]):
                best = started
            if model.num_registered >= self._options.min_share * len(group):
                break
        return best

    def _register_structure_less(self) -> bool:
        """Register photos that see too few points by two-view geometry; True if any was."""
        placed: list[int] = []
        for model in self._atlas.models:
            placed += model.register_structure_less(self._atlas.candidates_of(model))
        if placed:
            self._atlas.note(f"{len(placed)} photos registered without structure")
        return bool(placed)

    def _drop_small(self) -> None:
        covered: set[int] = set()
        kept: list[Model] = []
        for model in self._atlas.models:
            own = model.registered - covered
            if not kept or len(own) >= self._options.min_model_size:
                kept.append(model)
                covered |= own
            else:
                self._atlas.note(f"model with only {len(own)} photos of its own dropped")
        self._atlas.models = kept


def _size(model: Model) -> tuple[int, int]:
    return model.num_registered, model.num_points
