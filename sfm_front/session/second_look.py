"""A second look at photos that are poorly connected: more candidates, all features, no early exits.

What a photo is matched with when it arrives is chosen for dense captures. Where photos are wide
steps apart, the largest features are the wrong sample: pairs with over a hundred inliers among all
features had eight among those that re-ranking looks at.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np

from sfm_front.errors import ConfigError
from sfm_front.events import LookedAgain, ModelEvent
from sfm_front.mapping.atlas import Atlas
from sfm_front.matching.matcher import Matcher
from sfm_front.matching.verification import Verifier
from sfm_front.retrieval.retriever import Retriever
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.session.catalog import PhotoCatalog
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import PairGeometry, Rejected, Rejection, Uint32Array, View


@dataclass(frozen=True, kw_only=True)
class SecondLookOptions:
    """Which photos are looked at again, and how much that may cost."""

    # Pairs that may be matched per photo of the session: this takes about as long as describing
    # it, and is enough for all pairs of 25 photos.
    pairs_per_photo: int = 12
    # Nearest photos that a photo is matched with.
    candidates: int = 24
    # The same while others wait, and at the end, unless more than this share of the photos is
    # poorly connected: in a dense capture a few that nothing overlaps with must not cost much.
    hurried_candidates: int = 2
    sparse_share: float = 0.2
    # A photo that waits is looked at after so many others: they may place it for nothing.
    patience: int = 5
    # Verified pairs within its model that a registered photo needs to count as well connected.
    min_pairs: int = 3
    # Of a model that is not the largest, how many of its well connected photos are looked at; in a
    # session whose pairs may all be matched, all are.
    per_model: int = 6

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            least = 1 if name == "per_model" else 0
            if value < least:
                raise ConfigError(f"{name} must be at least {least}, got {value}")


class SecondLook:
    """Finds pairs that were missed, and hands them to database, view graph and models."""

    def __init__(
        self,
        options: SecondLookOptions,
        retriever: Retriever,
        matcher: Matcher,
        verifier: Verifier,
        workers: WorkerPool,
        catalog: PhotoCatalog,
        database: PhotoDatabase,
        atlas: Atlas,
        emit: Callable[[ModelEvent], None],
    ) -> None:
        """``emit`` hears what each look has found."""
        self._options = options
        self._retriever = retriever
        self._matcher = matcher
        self._verifier = verifier
        self._workers = workers
        self._catalog = catalog
        self._database = database
        self._atlas = atlas
        self._emit = emit
        # Image id → those it was matched with on all features. A pair that overlaps and was refused
        # later, for it rests on look-alikes, is not to come back.
        self._known: defaultdict[int, set[int]] = defaultdict(set)
        self._num_matched = 0
        # Image id → photos and candidates at the last look at it: with more, it may find more.
        self._looked_in: dict[int, tuple[int, int]] = {}

    def note(self, image_id: int, others: Iterable[int]) -> None:
        """These other photos were matched with this one on all features."""
        for other in others:
            self._known[image_id].add(other)
            self._known[other].add(image_id)

    def after(
        self, image_id: int, pairs: Iterable[PairGeometry], rejected: Mapping[int, Rejected]
    ) -> int | None:
        """Note what a photo that was added has been matched with: its verified pairs and those
        rejected, by image id. Returns the earlier photo to look at now, if one is due."""
        self.note(image_id, (pair.image_id2 for pair in pairs))
        # The unlikely ones were not matched on all features.
        matched = (i for i, why in rejected.items() if why.reason is not Rejection.UNLIKELY)
        self.note(image_id, matched)
        return self.due_after(image_id)

    def due_after(self, image_id: int) -> int | None:
        """The earlier photo to look at again once this one was added: it still waits, with few
        pairs."""
        atlas, earlier = self._atlas, image_id - self._options.patience
        if earlier < 1 or len(atlas.view_graph.neighbors(earlier)) >= self._options.min_pairs:
            return None
        return None if earlier in atlas.registered else earlier

    def at_photo(self, image_id: int) -> None:
        """Look again at one photo while others wait."""
        self._look(image_id, self._options.hurried_candidates)

    def while_idle(self) -> bool:
        """Look again at one photo that is poorly connected; False if no such look is left."""
        return self._step(self._poorly_connected(), self._options.candidates)

    def at_end(self) -> None:
        """Place what can be placed, and look again at all that stays poorly connected."""
        self._atlas.refine_until_stable()
        while True:
            photos = self._poorly_connected()
            if not self._step(photos, self._num_candidates_at_end(len(photos))):
                return

    def _num_candidates_at_end(self, num_poorly_connected: int) -> int:
        num_photos, options = len(self._catalog), self._options
        if self._can_afford_all:
            return num_photos
        is_sparse = num_poorly_connected > options.sparse_share * num_photos
        return options.candidates if is_sparse else options.hurried_candidates

    def _step(self, image_ids: Iterable[int], num_candidates: int) -> bool:
        """Look at the first of these photos with which that is still to be done."""
        return any(self._look(image_id, num_candidates) for image_id in image_ids)

    @property
    def budget(self) -> int:
        """Pairs that may still be matched."""
        return self._options.pairs_per_photo * len(self._catalog) - self._num_matched

    def _look(self, image_id: int, num_candidates: int) -> bool:
        """True if there were pairs to match."""
        circumstances = len(self._catalog), num_candidates
        if self._looked_in.get(image_id) == circumstances:
            return False
        self._looked_in[image_id] = circumstances
        others = self._chosen(image_id, num_candidates)
        if not others:
            return False
        pairs = self._matched(image_id, others)
        if pairs:
            self._database.write_pairs(pairs)
            self._atlas.take_pairs(pairs)
            # Where there were some, there may be more.
            del self._looked_in[image_id]
        found = (i for pair in pairs for i in (pair.image_id1, pair.image_id2) if i != image_id)
        self._emit(LookedAgain(image_id, tuple(found), len(others), self.budget))
        return True

    def _chosen(self, image_id: int, num_candidates: int) -> list[int]:
        """The nearest of those that the photo may overlap with."""
        nearest = self._retriever.nearest(
            image_id,
            num_candidates,
            without=self._known[image_id] | self._companions(image_id),
            expand_with=self._atlas.view_graph.neighbors(image_id),
        )
        return nearest[: max(0, self.budget)]

    def _companions(self, image_id: int) -> set[int]:
        """Photos it stands well connected with: further pairs with these would add nothing."""
        for model in self._atlas.models:
            registered = model.registered
            if image_id in registered and not self._has_few_pairs(image_id, registered):
                return registered
        return {image_id}

    def _poorly_connected(self) -> list[int]:
        """Photos in no model, those in one by few pairs, and some of each model but the largest."""
        found = dict.fromkeys(self._atlas.waiting)
        for number, model in enumerate(self._atlas.models):
            registered = model.registered
            photos = sorted(registered)
            loose = [i for i in photos if self._has_few_pairs(i, registered)]
            found.update(dict.fromkeys(loose))
            if number > 0:
                step = 1 if self._can_afford_all else -(-len(photos) // self._options.per_model)
                found.update(dict.fromkeys(photos[::step]))
        return list(found)

    @property
    def _can_afford_all(self) -> bool:
        return len(self._catalog) <= 2 * self._options.pairs_per_photo + 1

    def _has_few_pairs(self, image_id: int, photos: Set[int]) -> bool:
        graph = self._atlas.view_graph
        return graph.num_neighbors(image_id, photos) < self._options.min_pairs

    def _matched(self, image_id: int, other_ids: Sequence[int]) -> list[PairGeometry]:
        """Pairs of a photo with those that overlap with it, by all features."""
        self._num_matched += len(other_ids)
        self.note(image_id, other_ids)
        view, others = self._catalog[image_id], [self._catalog[i] for i in other_ids]
        matches = self._matcher.match(
            view.features, [other.features for other in others], [None] * len(others)
        )

        def verify(found: tuple[View, Uint32Array]) -> PairGeometry | Rejected:
            other, of_both = found
            # The later photo stands first in a pair.
            if other.image_id > image_id:
                return self._verifier.verify(other, view, np.ascontiguousarray(of_both[:, ::-1]))
            return self._verifier.verify(view, other, of_both)

        verdicts = self._workers.map(verify, zip(others, matches, strict=True))
        return [pair for pair in verdicts if isinstance(pair, PairGeometry)]
