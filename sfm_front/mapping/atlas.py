"""Several models at once over one scene: start, grow, join, and settle at the end."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace

from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.mapping.initialization import InitializationOptions, Initializer
from sfm_front.mapping.localization import LocalizationOptions, locate, registered_photo
from sfm_front.mapping.model import MapperOptions, Model
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.types import PairGeometry, View


@dataclass(frozen=True, kw_only=True)
class AtlasOptions:
    """When models are started and kept.

    ``min_second_model``: photos that must wait, linked to each other, before a further model is
    started. ``min_model_size``: photos of its own that a further model must have to be kept.
    ``max_missed_share``: of linked photos that may be in no model without a fresh start.
    ``min_share``: of the photos linked to a model that it should hold itself.
    ``fresh_starts``: how many starts of each relaxation the end of a session may try.
    ``max_failures``: fresh starts that may grow far and be no better before it gives up.
    """

    min_second_model: int = 4
    min_model_size: int = 3
    max_missed_share: float = 0.02
    min_share: float = 0.75
    fresh_starts: int = 2
    max_failures: int = 1
    initialization: InitializationOptions = field(default_factory=InitializationOptions)
    mapper: MapperOptions = field(default_factory=MapperOptions)
    localization: LocalizationOptions = field(default_factory=LocalizationOptions)


class Atlas:
    """All models of a session, largest first.

    A photo may be in several models while they grow: the largest takes the photos of smaller
    ones as soon as it sees them, and a model that has been taken over whole is dropped. That
    joins models, and it forgives a bad start: what grows from the photos that did not fit
    takes over what did.
    """

    def __init__(self, scene: ViewGraph, options: AtlasOptions | None = None) -> None:
        self._view_graph = scene
        self._options = options or AtlasOptions()
        self._clock = Stopwatch()
        self._initializer = Initializer(
            scene, self._options.initialization, self._options.mapper, self._clock
        )
        self._events: list[str] = []
        self.models: list[Model] = []

    @property
    def registered(self) -> set[int]:
        """Image ids of the photos that are in some model."""
        return set().union(*(model.registered for model in self.models))

    @property
    def waiting(self) -> list[int]:
        """Image ids of the photos that are in no model, in order of arrival."""
        registered = self.registered
        return [i for i in self._view_graph.image_ids if i not in registered]

    @property
    def num_points(self) -> int:
        """3-D points of all models."""
        return sum(model.num_points for model in self.models)

    def why_not_registered(self, image_id: int) -> str:
        """What keeps a waiting photo out of the models, in words."""
        neighbors = self._view_graph.neighbors(image_id).keys()
        if not neighbors:
            return "no verified matches with any photo"
        if not neighbors & self.registered:
            return "verified matches only with photos that are not registered"
        seen = max(model.num_visible_points(image_id) for model in self.models)
        return f"no pose fits the {seen} model points it sees"

    def take_refinement_seconds(self) -> float:
        """Wall seconds that global refinements took since the last call."""
        return self._clock.seconds.pop("refine", 0.0)

    def take_events(self) -> tuple[str, ...]:
        """What was started, relaxed, restarted or joined since the last call."""
        events, self._events = tuple(self._events), []
        return events

    def add(self, image_id: int) -> list[int]:
        """Take in a photo of the scene and place all that can be placed.

        Returns the image ids that are in some model now and were in none before.
        """
        before = self.registered
        for model in self.models:
            model.extend(image_id)
        self._grow()
        if image_id in self.waiting:
            self._start_near(image_id)
        return sorted(self.registered - before)

    def locate(self, view: View, pairs: Iterable[PairGeometry]) -> PosedCamera | None:
        """Pose in the largest model of a photo that is not in the scene yet, by these pairs.

        None where they do not tell.
        """
        if not self.models:
            return None
        model = self.models[0].reconstruction
        camera_id, keypoints = view.camera.camera_id, view.features.keypoints
        return locate(model, camera_id, keypoints, pairs, self._options.localization)

    def poses_of(self, image_ids: Iterable[int]) -> dict[int, PosedCamera]:
        """Cameras and poses of those of these photos that are in the largest model."""
        if not self.models:
            return {}
        model = self.models[0].reconstruction
        found = {image_id: registered_photo(model, image_id) for image_id in image_ids}
        return {image_id: posed for image_id, posed in found.items() if posed is not None}

    def finish(self) -> None:
        """Retry what waits, start afresh where the stream began badly, refine everything."""
        self._refine_until_stable()
        self._restart_largest()
        self._start_remaining()
        self._fix_intrinsics()
        self._drop_small()
        while self._register_structure_less():
            self._refine_until_stable()
        for model in self.models:
            model.finish()
        self.models = [model for model in self.models if model.num_registered > 1]
        self._drop_covered()

    def _grow(self) -> bool:
        """Grow every model, the largest first; True if any grew."""
        grew = False
        for model in list(self.models):
            grew |= bool(model.grow(self._candidates(model)))
        self._drop_covered()
        return grew

    def _candidates(self, model: Model) -> list[int]:
        """Photos that a model may take: the largest those of smaller models, too."""
        if model is self.models[0]:
            return self._view_graph.image_ids
        return self.waiting

    def _drop_covered(self) -> None:
        """Sort models by size and drop those that larger ones hold."""
        self.models.sort(key=lambda model: -model.num_registered)
        covered: set[int] = set()
        kept: list[Model] = []
        for model in self.models:
            own = model.registered - covered
            if own:
                kept.append(model)
                covered |= own
            else:
                self._events.append(
                    f"model of {model.num_registered} photos dropped: a larger one holds them all"
                )
        self.models = kept

    def _start_near(self, image_id: int) -> None:
        """Start a model among waiting photos linked to this one, if a pair is good enough."""
        group = self._view_graph.component([image_id], among=set(self.waiting))
        if self.models and len(group) < self._options.min_second_model:
            return
        started = self._initializer.start(group)
        if started is not None:
            model, event = started
            self._events.append(event)
            self.models.append(model)
            self._grow()

    def _refine_until_stable(self) -> None:
        """Refine and grow in turn until nothing more registers."""
        for model in self.models:
            model.forget_failures()
        while self._grow():
            for model in self.models:
                model.refine()
                model.forget_failures()

    def _restart_largest(self) -> None:
        """Where the largest model misses photos linked to it, grow it anew.

        The stream had to take the first pair that would do; the whole graph offers better ones.
        The better of old and new stays.
        """
        failures = 0
        for fresh, event in self._initializer.best_starts(self._options.fresh_starts):
            largest = self.models[0] if self.models else None
            if largest is not None and not self._misses(largest):
                return
            fresh.grow(self._view_graph.image_ids)
            if largest is None or fresh.num_registered > largest.num_registered:
                self._events.append(f"grown afresh: {event}")
                self.models.insert(0, fresh)
                self._refine_until_stable()
            elif 2 * fresh.num_registered > largest.num_registered:
                # A start that carried far and still placed no more: another hardly will.
                failures += 1
                if failures == self._options.max_failures:
                    return

    def _fix_intrinsics(self) -> None:
        """Grow models anew whose photos do not tell what their camera is, with what EXIF says.

        A nadir flight over flat ground leaves focal length and distortion open. On
        ``uav_garfield_rgb`` they have ended at 23 times the EXIF focal length, and the photos 62 m
        from GPS in the median, on a site of 185 m; with the camera held 13 m.
        """
        miscalibrated = [model for model in self.models if model.is_miscalibrated]
        held = replace(self._options.mapper, refine_intrinsics=False)
        initializer = Initializer(self._view_graph, self._options.initialization, held, self._clock)
        for model in miscalibrated:
            best = self._best_start(model.registered, initializer)
            if best is None:
                continue
            fresh, event = best
            if fresh.num_registered >= self._options.min_share * model.num_registered:
                self._events.append(f"grown afresh, the camera held as EXIF has it: {event}")
                self.models[self.models.index(model)] = fresh
        if miscalibrated:
            self._refine_until_stable()

    def _misses(self, model: Model) -> bool:
        """Whether photos linked to a model are in none, or too many in others."""
        linked = self._view_graph.component(model.registered)
        if len(linked - self.registered) > self._options.max_missed_share * len(linked):
            return True
        return model.num_registered < self._options.min_share * len(linked)

    def _start_remaining(self) -> None:
        """Further models from photos that are linked to each other and fit nowhere."""
        seen: set[int] = set()
        for image_id in self.waiting:
            if image_id in seen or image_id in self.registered:
                continue
            group = self._view_graph.component([image_id], among=set(self.waiting))
            seen |= group
            if len(group) < self._options.min_model_size:
                continue
            best = self._best_start(group, self._initializer)
            if best is not None:
                model, event = best
                self._events.append(event)
                self.models.append(model)
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
        """Register by two-view geometry alone what sees too few points; True if any was."""
        placed: list[int] = []
        for model in self.models:
            placed += model.register_structure_less(self._candidates(model))
        if placed:
            self._events.append(f"{len(placed)} photos registered without structure")
        return bool(placed)

    def _drop_small(self) -> None:
        covered: set[int] = set()
        kept: list[Model] = []
        for model in self.models:
            own = model.registered - covered
            if not kept or len(own) >= self._options.min_model_size:
                kept.append(model)
                covered |= own
            else:
                self._events.append(f"model with only {len(own)} photos of its own dropped")
        self.models = kept


def _size(model: Model) -> tuple[int, int]:
    return model.num_registered, model.num_points
