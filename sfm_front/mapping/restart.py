"""Another start for the largest model, where the stream began badly."""

from __future__ import annotations

from collections.abc import Iterator

from sfm_front.events import DropReason
from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.model import Model


class Restart:
    """Grows a model afresh over all photos if the largest one misses some; the better one stays.

    The stream had to take the first acceptable pair; the whole view graph offers better ones.
    """

    def __init__(self, atlas: Atlas) -> None:
        self._atlas = atlas
        self._revision = 0
        self._starts: Iterator[Model] = iter(())
        self._failures = 0
        self._fresh: Model | None = None

    def go_on(self, at_most: int | None = None) -> bool:
        """Grow the fresh model by this many photos, or begin one; False if none is worth it.

        Begins anew if the view graph has changed since the last call.
        """
        atlas = self._atlas
        if atlas.view_graph.revision != self._revision:
            self._revision, self._failures, self._fresh = atlas.view_graph.revision, 0, None
            self._starts = atlas.initializer.best_starts(
                max(atlas.options.fresh_starts, self._num_affordable)
            )
        if self._fresh is None:
            most = max(atlas.options.max_failures, self._num_affordable)
            if self._failures >= most or not self.misses_photos():
                return False
            self._fresh = next(self._starts, None)
            if self._fresh is None:
                return False
        if not self._fresh.grow(atlas.view_graph.image_ids, at_most):
            self._judge(self._fresh)
            self._fresh = None
        return True

    @property
    def _num_affordable(self) -> int:
        """Restarts of small models are cheap."""
        return self._atlas.options.cheap_restarts // max(1, len(self._atlas.view_graph))

    def _judge(self, fresh: Model) -> None:
        atlas = self._atlas
        best = atlas.models[0].num_registered if atlas.models else 0
        if fresh.num_registered > best:
            atlas.models.insert(0, fresh)
            atlas.refine_until_stable()
            return
        atlas.announce_drop(fresh, DropReason.NO_BETTER)
        far = len(self._linked()) if self._num_affordable else best
        if 2 * fresh.num_registered > far:
            # It grew far and still registered no more: another start hardly will.
            self._failures += 1

    def _linked(self) -> set[int]:
        """Photos that chains of pairs link to the largest model, its own included."""
        models = self._atlas.models
        return self._atlas.view_graph.component(models[0].registered) if models else set()

    def misses_photos(self) -> bool:
        """Whether photos linked to the largest model are in none, or too many in others."""
        atlas = self._atlas
        if not atlas.models:
            return True
        registered = atlas.models[0].registered
        linked = self._linked()
        missed = linked - atlas.registered
        if not self._num_affordable:
            # By fewer pairs, no other start would hold them either.
            graph, least = atlas.view_graph, atlas.options.min_links
            missed = {i for i in missed if graph.num_neighbors(i, registered) >= least}
        if len(missed) > atlas.options.max_missed_share * len(linked):
            return True
        return len(registered) < atlas.options.min_share * len(linked)
