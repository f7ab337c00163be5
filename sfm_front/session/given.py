"""A session whose photos are described and matched, and whose models are grown, by others."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import pycolmap

from sfm_front.events import PhotoAdded, PhotoDescribed
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.mapping.model_state import ModelState
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.reports.cluster_outcome import ClusterOutcome
from sfm_front.reports.event_log import EventLog
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.session.pair_matching import candidate_outcomes
from sfm_front.session.parts import restore
from sfm_front.session.session import Session
from sfm_front.session.snapshots import read_snapshot
from sfm_front.types import (
    Candidate,
    ExtractedPhoto,
    PairGeometry,
    PhotoPath,
    RankedCandidate,
    Rejected,
    Skipped,
    View,
)

_STAGE, _GROWING, _GROWN = "models of groups", "growing", "grown"


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """A photo that is described and waits to be matched with its candidates, best first."""

    photo: ExtractedPhoto
    view: View
    candidates: tuple[Candidate, ...]


class GivenSession(Session):
    """Holds an output as any session does, and ends as any does: ``finish`` joins the models given
    and does all the rest. Photos enter in order, each in one transaction, once they are matched, so
    that any session can go on with what is there."""

    def _restore(self, log: EventLog, *, is_known: bool) -> None:
        # Snapshots written meanwhile have the models of some groups only.
        whole = is_known and self.database.recall(_STAGE) != _GROWING
        snapshot = read_snapshot(self.output / "sparse") if whole else None
        restore(self._parts, snapshot, self._announcer, log, grow=False)

    def _map(self, image_id: int, /) -> list[int]:
        self._parts.atlas.know(image_id)
        return []  # it waits for the model of its group

    @property
    def view_graph(self) -> ViewGraph:
        """All verified pairs so far."""
        return self._parts.view_graph

    @property
    def global_descriptor(self) -> GlobalDescriptor:
        """What the global vectors must be made by."""
        return self._parts.extraction.global_descriptor

    @property
    def waiting(self) -> list[int]:
        """Photos that are in no model, by image id."""
        return self._parts.atlas.waiting

    @property
    def has_models(self) -> bool:
        """Whether there are any yet."""
        return bool(self._parts.atlas.models)

    @property
    def num_placed(self) -> int:
        """Photos that are in some model."""
        return len(self._parts.atlas.registered)

    def camera(self, image_id: int) -> pycolmap.Camera:
        """As a photo that has arrived started with it."""
        return self._parts.catalog.camera(image_id)

    def name(self, image_id: int) -> str:
        """Of a photo that has arrived."""
        return self._parts.catalog.name(image_id)

    def restored(self) -> Iterator[tuple[int, str]]:
        """Image ids and digests of the photos that were there when it began, or have entered."""
        for stored in self.database.photos():
            yield stored.image_id, stored.digest

    def announce(self, photo: PhotoPath) -> None:
        """A photo is about to be described."""
        self._arrive(photo)

    def arrive(self, photo: ExtractedPhoto | Skipped) -> Arrival | None:
        """Take in the next photo, which finds its candidates among those before it; None if it is
        not used."""
        if isinstance(photo, Skipped):
            self.add_extracted(photo)
            return None
        view = self._parts.catalog.admit(photo)
        if isinstance(view, Skipped):
            self.add_extracted(view)
            return None
        self._announcer.path_of(photo.name)
        self._announcer.tell(PhotoDescribed(photo.name, len(photo.features), photo.seconds))
        clock = Stopwatch()
        with clock.stage("retrieve"):
            candidates = self._parts.retriever.candidates(photo.global_vector)
        photo.seconds.update(clock.seconds)
        self._parts.retriever.remember(view.image_id, photo.global_vector)
        return Arrival(photo, view, tuple(candidates))

    def enter(
        self,
        arrival: Arrival,
        ranked: Sequence[RankedCandidate],
        pairs: Sequence[PairGeometry],
        rejected: Mapping[int, Rejected],
        seconds: Mapping[str, float],
    ) -> PhotoAdded:
        """Store a photo with the verified pairs that matching gave, in the order of arrival.

        ``rejected``: why other candidates that were matched have no pair, by image id; ``seconds``
        that it took, by stage.
        """
        parts, image_id = self._parts, arrival.view.image_id
        clock = Stopwatch()
        clock.seconds.update(seconds)
        unranked = arrival.candidates[len(ranked) :]
        outcomes = candidate_outcomes([*ranked, *unranked], pairs, rejected, parts.catalog.name)
        added = self._enter(arrival.photo, arrival.view, pairs, outcomes, clock)
        parts.second_look.after(image_id, pairs, rejected)
        return added

    def begin_growing(self) -> None:
        """Models of groups are about to be given. What is written of some is not gone on with."""
        if not self.has_models:
            self.database.remember(_STAGE, _GROWING)

    def take_models(
        self,
        models: Iterable[tuple[pycolmap.Reconstruction, ModelState]],
        *,
        in_place_of: Collection[int] = (),
    ) -> list[int]:
        """Take in the models of a group, or those that were joined of the ones with these ids;
        returns their ids."""
        atlas = self._parts.atlas

        def take() -> list[int]:
            atlas.remove(in_place_of)
            return [atlas.take_model(reconstruction, state) for reconstruction, state in models]

        taken = self._placing_more(take)
        self._write_snapshot_if_due()
        return taken

    def end_growing(self) -> None:
        """All of them are there, and on the disk when this returns."""
        self._write_snapshot()
        self.database.remember(_STAGE, _GROWN)

    def note_cluster(self, outcome: ClusterOutcome) -> None:
        """What workers did, for the report; before ``finish``."""
        self._parts.report.cluster = outcome
