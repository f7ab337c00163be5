"""One photo's path: describe, retrieve, verify, store, map, remember."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TypeVar

from sfm_front.errors import StorageError
from sfm_front.events import (
    FinishingStep,
    Listener,
    ModelEvent,
    PhotoAdded,
    PhotoDescribed,
    SessionEnded,
    SessionStarted,
)
from sfm_front.features.global_descriptors.descriptor import resolve
from sfm_front.georeference.georeferencer import Georeference
from sfm_front.mapping.audit import audit
from sfm_front.mapping.finishing import finish
from sfm_front.mapping.unfolding import unfold
from sfm_front.reports.event_log import EventLog
from sfm_front.reports.report_json import write_report
from sfm_front.reports.retrieval_log import RetrievalLog
from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.devices import usable_device
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.session.announcer import Announcer
from sfm_front.session.control_points import ControlPoints
from sfm_front.session.options import SessionOptions
from sfm_front.session.output_folder import (
    check_output_folder,
    open_output_folder,
    remove_working_folder,
)
from sfm_front.session.pair_matching import candidate_outcomes
from sfm_front.session.parts import open_parts, restore
from sfm_front.session.photo_account import photo_added
from sfm_front.session.photo_positions import PhotoPositions
from sfm_front.session.resume import as_dict, check_options, mark_finished, mark_running
from sfm_front.session.snapshots import MakeSidecar, Snapshots, read_snapshot
from sfm_front.session.summing_up import SessionResult, sum_up
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import (
    CandidateOutcome,
    ExtractedPhoto,
    ModelSummary,
    NotYet,
    PairGeometry,
    PhotoPath,
    Skipped,
    View,
)
from sfm_front.version import VERSION

Result = TypeVar("Result")

# Photos that follow each other faster than this must not wait for a refinement.
_IDLE_AFTER_S = 2.0
# A restart registers so many photos before it is asked again whether another one has come.
_PHOTOS_AT_A_TIME = 2


class Session(Closeable):
    """Reconstructs photos that arrive one at a time.

    ::

        with Session(Path("outputs/flight")) as session:
            for path in paths:
                session.add(path)
            result = session.finish()

    ``output`` receives ``database.db``, ``retrieval.jsonl``, ``events.jsonl``, ``report.json`` and
    ``sparse/``.
    """

    def __init__(
        self,
        output: Path,
        options: SessionOptions | None = None,
        *,
        overwrite: bool = False,
        resume: bool = False,
        on_event: Listener | None = None,
        command: str = "",
    ) -> None:
        """``overwrite`` removes what an earlier session wrote to ``output``, and nothing else;
        ``resume`` goes on with it, however it ended.

        ``on_event`` is called with each event when it happens, in the thread that calls the
        session, as ``events.jsonl`` has them. ``command``: what a user gives to go on with this
        session, for those who look at one that was stopped.

        Raises InputError if there is such a session and neither is wanted, if it was made with
        other options, if another process writes to it, or if the file of positions or of control
        points is no such; ConfigError, WeightsError or DependencyError if the global descriptor
        cannot be had, or a library that positions need. Nothing has been written or removed then.
        """
        self.options = options or SessionOptions()
        self.output = output
        check_output_folder(output, overwrite=overwrite, resume=resume)
        device, on_device = usable_device(self.options.device)
        descriptor, on_descriptor = resolve(
            self.options.global_descriptor,
            weights=self.options.weights,
            vlad_weight=self.options.vlad_weight,
            device=device,
        )
        positions = PhotoPositions(self.options.positions)
        self._announcer = Announcer([] if on_event is None else [on_event], self.options)
        control_points = ControlPoints(self.options.control_points, self._announcer.tell_of_model)
        self.messages = tuple(line for line in (on_device, on_descriptor) if line)
        self._finished = False
        # Whether the models were settled since the last photo.
        self._is_settled = True
        self._idle_since_s: float | None = None
        self._idle_events: list[ModelEvent] = []
        # What is open is closed again if a later part cannot be made.
        with ExitStack() as opened:
            lock = open_output_folder(output, overwrite=overwrite, resume=resume)
            opened.callback(lock.close)
            self._parts = open_parts(
                opened,
                output,
                self.options,
                device,
                descriptor,
                positions,
                control_points,
                self._announcer,
            )
            self._go_on(opened, command)
            self._opened = opened.pop_all()

    @property
    def database(self) -> PhotoDatabase:
        """What is known of all photos."""
        return self._parts.database

    @property
    def georeference(self) -> Georeference:
        """Where the largest model stands on the earth, as far as positions told when it was looked
        at last."""
        return self._parts.georeferencing.georeference

    def _go_on(self, opened: ExitStack, command: str) -> None:
        """Where an earlier run of this session stopped, if there was one."""
        known = check_options(self.database, self.options, self.output)
        self._retrieval_log = opened.enter_context(
            RetrievalLog(self.output, self.database.photos())
        )
        event_log = opened.enter_context(EventLog.in_folder(self.output))
        self._announcer.add_listener(event_log.write)
        self._snapshots = Snapshots(self.output / "sparse", self.options.snapshot_seconds)
        self.num_restored = self.database.num_photos()
        options = as_dict(self.options)
        self._announcer.tell(SessionStarted(VERSION, options, self.num_restored, command))
        mark_running(self.database, self.options)
        self._restore(event_log, is_known=known)

    def _restore(self, log: EventLog, *, is_known: bool) -> None:
        snapshot = read_snapshot(self.output / "sparse") if is_known else None
        restore(self._parts, snapshot, self._announcer, log)

    def add(self, path: Path, name: str | None = None) -> PhotoAdded | Skipped:
        """Take in one photo; ``name`` is what it is called in the models (default: the file's)."""
        photo = self._announcer.arrive(PhotoPath(name or path.name, path))
        return self.add_extracted(self._parts.extraction.describe(photo))

    def add_all(self, photos: Iterable[PhotoPath | NotYet]) -> Iterator[PhotoAdded | Skipped]:
        """Take in photos in order; the next ones are described while one is matched and mapped.

        ``NotYet`` among them, as ``photos.watch`` gives it, lets the session use the time.
        """
        for extracted in self._parts.extraction.stream(map(self._arrive, photos)):
            if isinstance(extracted, NotYet):
                self.idle(extracted.seconds)
            else:
                yield self.add_extracted(extracted)

    def idle(self, seconds: float) -> None:
        """Nothing has arrived for ``seconds``, and nothing is under way: refine, retry photos that
        wait, and look again at those poorly connected, until nothing changes any more. To be
        called again and again meanwhile."""
        if self._idle_since_s is None:
            self._idle_since_s = time.monotonic()
        if self._is_settled or seconds < _IDLE_AFTER_S:
            return
        self._is_settled = self._placing_more(self._settle)
        # The next photo must not be charged with them.
        self._idle_events += self._announcer.pop_model_events()
        if self._is_settled:
            self._georeference()
            self._write_snapshot()

    def _settle(self) -> bool:
        """Do what is next; True if nothing is left to be done."""
        parts = self._parts
        return (
            parts.atlas.settle()
            and not parts.second_look.while_idle()
            and not parts.restart.go_on(_PHOTOS_AT_A_TIME)
            # Last, for it looks at all that there is each time.
            and not unfold(parts.atlas)
        )

    @property
    def idle_s(self) -> float:
        """Seconds for which nothing has been under way."""
        return 0.0 if self._idle_since_s is None else time.monotonic() - self._idle_since_s

    def _arrive(self, photo: PhotoPath | NotYet) -> PhotoPath | NotYet:
        if isinstance(photo, NotYet):
            return photo
        self._idle_since_s = None
        return self._announcer.arrive(photo)

    def add_extracted(self, photo: ExtractedPhoto | Skipped) -> PhotoAdded | Skipped:
        """Take in a photo whose features are extracted already.

        Raises RuntimeError once the session is finished: its models are final. Raises StorageError
        if the photo cannot be written down; nothing of it is there then.
        """
        if self._finished:
            raise RuntimeError("the session is finished: begin another one for more photos")
        path = self._announcer.path_of(photo.name)
        added = photo if isinstance(photo, Skipped) else self._add(photo)
        if isinstance(added, Skipped):
            self.database.write_skipped(added, path)
            self._parts.report.add(added)
            self._announcer.tell(added)
        self._write_snapshot_if_due()
        return added

    def finish(self, num_left: int = 0) -> SessionResult:
        """Place what can still be placed, refine, export; ``num_left`` photos are not taken."""
        if self._finished:
            raise RuntimeError("the session is finished already")
        self._finished = True
        clock = Stopwatch()
        with clock.stage("look again"):
            self._announcer.begin(FinishingStep.LOOK_AGAIN)
            self._placing_more(self._parts.second_look.at_end)
            self._write_snapshot_if_due()  # It may have placed many, and adjusting takes long.
        with clock.stage("finish"):
            self._parts.catalog.forget_features()
            self._placing_more(
                lambda: finish(
                    self._parts.atlas,
                    self._parts.restart,
                    self._georeference,
                    self._announcer.begin,
                )
            )
            self._georeference()
            if self.options.control_points.file is not None:
                self._announcer.begin(FinishingStep.CONTROL_POINTS)
            self._parts.control_points.hold(self._parts.atlas.models, self._parts.georeferencing)
            self._announcer.begin(FinishingStep.CHECK)
            audits = [
                audit(model.reconstruction, self._parts.view_graph)
                for model in self._parts.atlas.models
            ]
        with clock.stage("export"):
            self._announcer.begin(FinishingStep.WRITE)
            self.database.write_priors(self._parts.positions.checked().usable)
            positions = self._parts.georeferencing.outcome(
                self._parts.atlas.models, self._parts.control_points.report
            )
            models = self._export(lambda: positions.sidecar if positions else None, final=True)
        summary = sum_up(
            self._parts,
            self.options,
            models,
            audits=audits,
            georeference=positions,
            seconds=clock.seconds,
            events=(*self._idle_events, *self._announcer.pop_model_events()),
            latencies_s=self._announcer.latencies_s,
        )
        write_report(self.output, summary)
        mark_finished(self.database)
        remove_working_folder(self.output)
        totals = summary.totals
        self._announcer.tell(
            SessionEnded(True, totals.num_used, totals.num_registered, len(models), num_left)
        )
        return SessionResult(tuple(models), summary)

    def close(self) -> None:
        """End; without ``finish``, the same session can be gone on with."""
        if not self._finished:
            self._finished = True
            atlas, num_photos = self._parts.atlas, len(self._parts.catalog)
            ended = SessionEnded(False, num_photos, len(atlas.registered), len(atlas.models))
            # The disk may be full, or the output gone: that was told when it was met.
            with suppress(StorageError):
                self._announcer.tell(ended)
        self._opened.close()

    def _georeference(self) -> None:
        self._parts.georeferencing.settle(self._parts.atlas.models)

    def _placing_more(self, act: Callable[[], Result]) -> Result:
        """Do something that may place photos that wait, and tell of those."""
        atlas = self._parts.atlas
        before = atlas.registered
        result = act()
        if refused := atlas.view_graph.pop_reduced():
            self.database.keep_matches(refused)
        for image_id in sorted(atlas.registered - before):
            self._announcer.tell_placed(atlas, image_id)
        return result

    def _write_snapshot_if_due(self) -> None:
        if self._snapshots.is_due:
            self._write_snapshot()

    def _write_snapshot(self) -> None:
        self._export(lambda: self._parts.georeferencing.sidecar(self._parts.atlas.models))

    def _export(self, sidecar: MakeSidecar, *, final: bool = False) -> list[ModelSummary]:
        catalog = self._parts.catalog
        return self._snapshots.write(
            self._parts.atlas.models,
            len(catalog),
            catalog.colors,
            self._parts.georeferencing.as_json(),
            sidecar,
            final=final,
            text=final and self.options.text,
        )

    def _add(self, photo: ExtractedPhoto) -> PhotoAdded | Skipped:
        """The method: retrieve, re-rank, match and verify, store, map, remember."""
        parts, clock = self._parts, Stopwatch()
        view = parts.catalog.admit(photo)
        if isinstance(view, Skipped):
            return view
        self._announcer.tell(PhotoDescribed(photo.name, len(photo.features), photo.seconds))
        image_id = view.image_id
        with clock.stage("retrieve"):
            candidates = parts.retriever.candidates(photo.global_vector)
        with clock.stage("rerank"):
            enough = self.options.pair_matching.num_matched
            ranked = parts.reranker.rerank(view, candidates, parts.catalog, enough=enough)
        pairs, rejected = parts.pairs.match(
            view,
            ranked,
            parts.catalog,
            locate=parts.atlas.locate,
            poses_of=parts.atlas.poses_of,
            clock=clock,
        )
        unranked = candidates[len(ranked) :]
        outcomes = candidate_outcomes([*ranked, *unranked], pairs, rejected, parts.catalog.name)
        added = self._enter(photo, view, pairs, outcomes, clock)
        parts.retriever.remember(image_id, photo.global_vector)
        due = parts.second_look.after(image_id, pairs, rejected)
        if due is not None:
            self._placing_more(lambda: parts.second_look.at_photo(due))
        return added

    def _enter(
        self,
        photo: ExtractedPhoto,
        view: View,
        pairs: Sequence[PairGeometry],
        outcomes: tuple[CandidateOutcome, ...],
        clock: Stopwatch,
    ) -> PhotoAdded:
        """Store and map a matched photo, and tell of it."""
        parts, image_id = self._parts, view.image_id
        with clock.stage("store"):
            parts.control_points.take(photo.name, (photo.width, photo.height))
            prior = parts.positions.take(image_id, photo.name, photo.exif)
            parts.database.write(image_id, photo, view.camera, pairs, outcomes, prior=prior)
        with clock.stage("map"):
            keypoints = photo.features.keypoints
            parts.view_graph.add(image_id, photo.name, view.camera, keypoints, pairs)
            registered = self._map(image_id)
        events = self._announcer.pop_model_events()
        added = photo_added(parts, photo, image_id, outcomes, registered, clock, events)
        self._is_settled = False
        parts.report.add(added)
        self._retrieval_log.add(added)
        self._announcer.tell(added)
        self._announcer.tell_outcome(parts.atlas, image_id, registered)
        return added

    def _map(self, image_id: int, /) -> list[int]:
        """Place what can be placed once this photo is in the view graph."""
        registered = self._parts.atlas.add(image_id)
        self._parts.georeferencing.follow(self._parts.atlas.models)
        return registered
