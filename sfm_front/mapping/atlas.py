"""Several models at once over one view graph, while photos arrive: start, grow, drop."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.events import (
    DropReason,
    Emit,
    ModelDropped,
    ModelEvent,
    StartKind,
)
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.mapping.background_refinement import BackgroundAdjuster
from sfm_front.mapping.initialization import InitializationOptions, Initializer
from sfm_front.mapping.joining import Joiner, JoiningOptions
from sfm_front.mapping.lens_growth import simplify_lenses
from sfm_front.mapping.localization import LocalizationOptions, locate, registered_photo
from sfm_front.mapping.lookalikes import FoldOptions
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.mapping.model import Model
from sfm_front.mapping.model_state import ModelState
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import PairGeometry, View, Waiting, WaitingReason


@dataclass(frozen=True, kw_only=True)
class AtlasOptions:
    """When models are started and kept."""

    # Linked photos that must wait before a further model is started.
    min_second_model: int = 4
    # Photos in no larger model that a further model must have to be kept.
    min_model_size: int = 3
    # Share of linked photos that may be in no model without a restart.
    max_missed_share: float = 0.02
    # Pairs with photos of the model by which a photo must be linked for that, in large models.
    min_links: int = 3
    # Share of the photos linked to a model that it should register itself.
    min_share: float = 0.75
    # Restarts per constraint level that the end of a session may try.
    fresh_starts: int = 2
    # Restarts that may register over half as many photos as the best model, but no more than it,
    # before giving up.
    max_failures: int = 1
    # Small models may have more of both, as many as register so many photos in all; of those only
    # a restart that registers over half of the linked photos counts as a failure.
    cheap_restarts: int = 40
    initialization: InitializationOptions = field(default_factory=InitializationOptions)
    mapper: MapperOptions = field(default_factory=MapperOptions)
    localization: LocalizationOptions = field(default_factory=LocalizationOptions)
    joining: JoiningOptions = field(default_factory=JoiningOptions)
    fold: FoldOptions = field(default_factory=FoldOptions)

    def __post_init__(self) -> None:
        for name in ("min_second_model", "min_model_size"):
            if getattr(self, name) < 2:
                raise ConfigError(f"{name} must be at least 2, got {getattr(self, name)}")
        for name in ("max_missed_share", "min_share"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"{name} must be from 0 to 1, got {getattr(self, name)}")
        for name in ("fresh_starts", "max_failures", "cheap_restarts"):
            if getattr(self, name) < 0:
                raise ConfigError(f"{name} must not be negative, got {getattr(self, name)}")


class Atlas:
    """All models of a session, largest first.

    Models that photos link are joined. Where they do not fit each other, a photo may be in several
    while they grow: the largest registers the photos of smaller ones as soon as it sees them, and a
    model whose photos larger ones hold is dropped. This recovers from a bad start: a model grown
    from the photos that did not fit takes over the rest.
    """

    def __init__(
        self,
        view_graph: ViewGraph,
        options: AtlasOptions | None = None,
        emit: Emit | None = None,
        adjuster: BackgroundAdjuster | None = None,
    ) -> None:
        """``emit`` hears what becomes of the models, when it does. With an ``adjuster`` no photo
        waits for a refinement of a whole model."""
        self._adjuster = adjuster
        self.view_graph = view_graph
        self.options = options or AtlasOptions()
        self.emit = emit or _ignore
        self.initializer = Initializer(
            view_graph,
            self.options.initialization,
            self.options.mapper,
            self.emit,
            adjuster=adjuster,
        )
        self._joiner = Joiner(view_graph, self.options.joining, self.options.mapper, self.emit)
        self.models: list[Model] = []

    def restore(self, models: Iterable[tuple[pycolmap.Reconstruction, ModelState]]) -> None:
        """Go on from models of an earlier run, all of whose photos are in the view graph."""
        for reconstruction, state in models:
            simplify_lenses(reconstruction, self.view_graph.cameras, self.options.mapper.robust)
            self.models.append(
                Model.restored(
                    self.view_graph,
                    self.options.mapper,
                    reconstruction,
                    state,
                    self.emit,
                    self._adjuster,
                )
            )
        self.initializer.go_on_after(max((model.model_id for model in self.models), default=0))

    def take_model(self, reconstruction: pycolmap.Reconstruction, state: ModelState) -> int:
        """Take in one that was grown elsewhere over the same photos; returns its id here.

        It is joined to others when they grow."""
        model = Model.restored(
            self.view_graph,
            self.options.mapper,
            reconstruction,
            replace(state, model_id=self.initializer.next_id()),
            self.emit,
            self._adjuster,
        )
        self.models.append(model)
        self.drop_covered()
        return model.model_id

    def remove(self, model_ids: Collection[int]) -> None:
        """Others hold what these models hold."""
        self.models = [model for model in self.models if model.model_id not in model_ids]

    @property
    def registered(self) -> set[int]:
        """Image ids of the photos that are in some model."""
        return set().union(*(model.registered for model in self.models))

    def model_of(self, image_id: int) -> Model:
        """The largest model that holds a registered photo. Raises KeyError if none does."""
        for model in self.models:
            if model.reconstruction.image(image_id).has_pose:
                return model
        raise KeyError(image_id)

    @property
    def waiting(self) -> list[int]:
        """Image ids of the photos that are in no model, in order of arrival."""
        registered = self.registered
        return [i for i in self.view_graph.image_ids if i not in registered]

    @property
    def num_points(self) -> int:
        """3-D points of all models."""
        return sum(model.num_points for model in self.models)

    def why_not_registered(self, image_id: int) -> Waiting:
        """What keeps a waiting photo out of the models."""
        neighbors = self.view_graph.neighbors(image_id).keys()
        if not neighbors:
            return Waiting(WaitingReason.NO_MATCHES)
        if not neighbors & self.registered:
            return Waiting(WaitingReason.NEIGHBORS_WAIT)
        seen = max(model.num_visible_points(image_id) for model in self.models)
        return Waiting(WaitingReason.NO_POSE, seen)

    def add(self, image_id: int) -> list[int]:
        """Take in a photo of the view graph and place all that can be placed.

        Returns the image ids that are in some model now and were in none before.
        """
        before = self.registered
        self.know(image_id)
        self.grow()
        if image_id in self.waiting:
            self._start_near(image_id)
        return sorted(self.registered - before)

    def know(self, image_id: int) -> None:
        """Make a photo of the view graph known to the models, without placing it."""
        for model in self.models:
            model.extend(image_id)

    def take_pairs(self, pairs: Sequence[PairGeometry]) -> None:
        """Take in pairs of photos that are there already, and place all that can be placed."""
        self.view_graph.add_pairs(pairs)
        image_ids = sorted({i for pair in pairs for i in (pair.image_id1, pair.image_id2)})
        for model in self.models:
            model.take_pairs(image_ids)
        self.grow()
        for image_id in image_ids:
            if image_id in self.waiting:
                self._start_near(image_id)

    def locate(self, view: View, pairs: Iterable[PairGeometry]) -> PosedCamera | None:
        """Pose in the largest model of a photo that is not in the view graph yet, by these pairs.

        None if they do not tell.
        """
        if not self.models:
            return None
        model = self.models[0].reconstruction
        camera_id, keypoints = view.camera.camera_id, view.features.keypoints
        return locate(model, camera_id, keypoints, pairs, self.options.localization)

    def poses_of(self, image_ids: Iterable[int]) -> dict[int, PosedCamera]:
        """Cameras and poses of those of these photos that are in the largest model."""
        if not self.models:
            return {}
        model = self.models[0].reconstruction
        found = {image_id: registered_photo(model, image_id) for image_id in image_ids}
        return {image_id: posed for image_id, posed in found.items() if posed is not None}

    def replace(self, model: Model, parts: Sequence[Collection[int]]) -> None:
        """Put models of parts of its photos in the place of a model, once matches have left the
        view graph; the first part keeps its id."""
        parted = [model.only(part) for part in parts]
        for part in parted[1:]:
            part.model_id = self.initializer.next_id()
        # Those over the view graph as it was would still see what has left it.
        kept = [other.only(other.registered) for other in self.models if other is not model]
        self.models = parted + kept
        self.drop_covered()

    def grow(self) -> bool:
        """Join models that belong together, then grow each, the largest first.

        True if any grew.
        """
        num_models = len(self.models)
        self.models = self._joiner.join(self.models)
        grew = len(self.models) < num_models
        for model in list(self.models):
            grew |= bool(model.grow(self.candidates_of(model)))
        self.drop_covered()
        return grew

    def settle(self) -> bool:
        """Refine all models, and register what fits them then.

        False if that is not yet done: a model is refined in the background, or has grown.
        """
        if not all(model.settle() for model in self.models):
            return False
        self._forget_failures()
        return not self.grow()

    def refine_until_stable(self) -> None:
        """Grow and refine in turn until nothing more registers; what failed is retried."""
        self._forget_failures()
        while self.grow():
            for model in self.models:
                model.refine()
            self._forget_failures()

    def candidates_of(self, model: Model) -> list[int]:
        """Photos that a model may register; for the largest, those of smaller models too."""
        if model is self.models[0]:
            return self.view_graph.image_ids
        return self.waiting

    def drop_covered(self) -> None:
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
                self.announce_drop(model, DropReason.COVERED)
        self.models = kept

    def announce_drop(self, model: Model, reason: DropReason) -> None:
        """Emit that a model is no longer grown."""
        self.emit(ModelDropped(model.model_id, model.num_registered, reason))

    def _forget_failures(self) -> None:
        """Allow every photo and every join to be tried again."""
        self._joiner.forget_failures()
        for model in self.models:
            model.forget_failures()

    def _start_near(self, image_id: int) -> None:
        """Start a model among waiting photos linked to this one, if a pair is good enough."""
        group = self.view_graph.component([image_id], among=set(self.waiting))
        if self.models and len(group) < self.options.min_second_model:
            return
        model = self.initializer.start(group, StartKind.STREAM)
        if model is not None:
            self.models.append(model)
            self.grow()


def _ignore(_: ModelEvent) -> None:
    pass
