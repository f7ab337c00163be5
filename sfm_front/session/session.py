"""One photo's path: describe, retrieve, verify, store, map, remember."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from sfm_front.events import (
    Listener,
    ModelEvent,
    ModelRefined,
    PhotoAdded,
    SessionEnded,
    SessionStarted,
)
from sfm_front.features.extraction import FeatureExtraction, make_extractor
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor, resolve
from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.background_refinement import BackgroundAdjuster
from sfm_front.mapping.finishing import finish
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.matching.guided_matching import GuidedMatcher
from sfm_front.matching.matcher import make_matcher
from sfm_front.matching.verification import Verifier
from sfm_front.photos.reader import PhotoReader
from sfm_front.reports.event_log import EventLog
from sfm_front.reports.report_json import write_report
from sfm_front.reports.retrieval_log import RetrievalLog
from sfm_front.reports.run_report import RunReport
from sfm_front.reports.run_summary import RunSummary
from sfm_front.retrieval.rerank import Reranker
from sfm_front.retrieval.retriever import Retriever
from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.devices import usable_device
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.session.announcer import Announcer
from sfm_front.session.catalog import PhotoCatalog
from sfm_front.session.options import SessionOptions
from sfm_front.session.output_folder import (
    DATABASE,
    check_output_folder,
    open_output_folder,
)
from sfm_front.session.pair_matching import CandidateMatcher
from sfm_front.session.resume import as_dict, check_options, mark_finished, mark_running
from sfm_front.session.snapshots import Snapshots, read_snapshot
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import (
    Candidate,
    CandidateOutcome,
    ExtractedPhoto,
    ModelSummary,
    NotYet,
    PairGeometry,
    PhotoPath,
    RankedCandidate,
    Rejected,
    Skipped,
)
from sfm_front.version import VERSION

# Photos that follow each other faster than this must not wait for a refinement.
_IDLE_AFTER_S = 2.0


@dataclass(frozen=True, slots=True)
class SessionResult:
    """Finished models, the largest first, and what ``report.json`` says."""

    models: tuple[ModelSummary, ...]
    summary: RunSummary


class Session(Closeable):
    """Reconstructs photos that arrive one at a time.

    ::

        with Session(Path("outputs/flight")) as session:
            for path in paths:
                session.add(path)
            result = session.finish()

    ``output`` receives ``database.db``, ``retrieval.jsonl``, ``report.json`` and ``sparse/``.
    """

    def __init__(
        self,
        output: Path,
        options: SessionOptions | None = None,
        *,
        overwrite: bool = False,
        resume: bool = False,
        on_event: Listener | None = None,
    ) -> None:
        """``overwrite`` removes what an earlier session wrote to ``output``, and nothing else;
        ``resume`` goes on with it, however it ended.

        ``on_event`` is called with each event when it happens, in the thread that calls the
        session, as ``events.jsonl`` has them.

        Raises InputError if there is such a session and neither is wanted, if it was made with
        other options, or if another process writes to it; ConfigError, WeightsError or
        DependencyError if the global descriptor cannot be had. Nothing has been written or removed
        then.
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
        self.messages = tuple(line for line in (on_device, on_descriptor) if line)
        self._finished = False
        # Whether the time has been used since the last photo.
        self._is_idle = True
        self._idle_events: list[ModelEvent] = []
        self._announcer = Announcer([] if on_event is None else [on_event])
        # What is open is closed again if a later part cannot be made.
        with ExitStack() as opened:
            lock = open_output_folder(output, overwrite=overwrite, resume=resume)
            opened.callback(lock.close)
            self._open(opened, device, descriptor)
            self._restore(opened)
            self._opened = opened.pop_all()

    def _open(self, opened: ExitStack, device: str, descriptor: GlobalDescriptor) -> None:
        threads = self.options.threads
        self._extraction = FeatureExtraction(
            PhotoReader(max_image_size=self.options.max_image_size),
            make_extractor(device, self.options.sift),
            descriptor,
            num_threads=threads,
        )
        opened.callback(self._extraction.close)
        self._workers = WorkerPool(threads)
        opened.callback(self._workers.close)
        verifier = Verifier(self.options.verification)
        matcher = make_matcher(device, self.options.matching, self._workers)
        self._reranker, second_reranker = (
            Reranker(
                options, matcher, verifier, self._workers, rotation=self.options.matching.rotation
            )
            for options in (self.options.rerank, self.options.second_rerank)
        )
        guided = GuidedMatcher(
            self.options.guided, self.options.matching, self.options.verification, self._workers
        )
        self._pairs = CandidateMatcher(
            self.options.pair_matching, matcher, second_reranker, verifier, guided, self._workers
        )
        self._retriever = Retriever(self.options.retrieval, descriptor.dimension)
        self.database = PhotoDatabase(self.output / DATABASE)
        opened.callback(self.database.close)
        self._catalog = PhotoCatalog(
            self.options.cameras, self.database.features, self.options.cache_bytes
        )
        self._view_graph = ViewGraph()
        adjuster = None
        # With one thread a session is the same to the bit each time: nothing runs beside it.
        if threads > 1:
            adjuster = BackgroundAdjuster()
            opened.callback(adjuster.close)
        self._atlas = Atlas(
            self._view_graph, self.options.atlas, self._announcer.tell_of_model, adjuster
        )
        self._snapshots = Snapshots(self.output / "sparse", self.options.snapshot_seconds)
        self._report = RunReport()

    def _restore(self, opened: ExitStack) -> None:
        """Go on where an earlier run of this session stopped, if there was one."""
        known = check_options(self.database, self.options, self.output)
        self._retrieval_log = RetrievalLog(self.output, self.database.photos())
        opened.callback(self._retrieval_log.close)
        event_log = EventLog.in_folder(self.output)
        opened.callback(event_log.close)
        self._announcer.add_listener(event_log.write)
        snapshot = read_snapshot(self.output / "sparse") if known else None
        self.num_restored = self.database.num_photos()
        self._announcer.tell(SessionStarted(VERSION, as_dict(self.options), self.num_restored))
        mark_running(self.database)
        for skipped, _ in self.database.skipped():
            self._report.add(skipped)
        cameras = self.database.cameras()
        num_mapped = 0
        if snapshot is not None and snapshot.num_photos <= self.num_restored:
            num_mapped = snapshot.num_photos
        for photo in self.database.photos():
            features, camera = self.database.features(photo.image_id), cameras[photo.camera_id]
            self._catalog.restore(photo, camera, features.colors)
            self._retriever.remember(photo.image_id, photo.global_vector)
            self._report.restore(photo)
            self._view_graph.add(
                photo.image_id,
                photo.name,
                camera,
                features.keypoints,
                self.database.pairs(photo.image_id),
            )
            if snapshot is not None and photo.image_id == num_mapped:
                self._atlas.restore(snapshot.models)
            elif photo.image_id > num_mapped:
                placed = self._atlas.add(photo.image_id)
                self._announcer.tell_outcome(self._atlas, photo.image_id, placed)
        self._announcer.pop_model_events()

    def add(self, path: Path, name: str | None = None) -> PhotoAdded | Skipped:
        """Take in one photo; ``name`` is what it is called in the models (default: the file's)."""
        photo = self._announcer.arrive(PhotoPath(name or path.name, path))
        return self.add_extracted(self._extraction.describe(photo))

    def add_all(self, photos: Iterable[PhotoPath | NotYet]) -> Iterator[PhotoAdded | Skipped]:
        """Take in photos in order; the next ones are described while one is matched and mapped.

        ``NotYet`` among them, as ``photos.watch`` gives it, lets the session use the time.
        """
        for extracted in self._extraction.stream(map(self._arrive, photos)):
            if isinstance(extracted, NotYet):
                self.idle(extracted.seconds)
            else:
                yield self.add_extracted(extracted)

    def idle(self, seconds: float) -> None:
        """Nothing has arrived for ``seconds``: retry photos that wait, and refine, once."""
        if self._is_idle or seconds < _IDLE_AFTER_S:
            return
        self._is_idle = True
        before = self._atlas.registered
        self._atlas.settle()
        for image_id in sorted(self._atlas.registered - before):
            self._announcer.tell_placed(self._atlas, image_id)
        # The next photo must not be charged with them.
        self._idle_events += self._announcer.pop_model_events()
        self._snapshots.write(self._atlas.models, len(self._catalog), self._catalog.colors)

    def _arrive(self, photo: PhotoPath | NotYet) -> PhotoPath | NotYet:
        return photo if isinstance(photo, NotYet) else self._announcer.arrive(photo)

    def add_extracted(self, photo: ExtractedPhoto | Skipped) -> PhotoAdded | Skipped:
        """Take in a photo whose features are extracted already.

        Raises RuntimeError once the session is finished: its models are final. Raises StorageError
        if the photo cannot be written down; nothing of it is there then.
        """
        if self._finished:
            raise RuntimeError("the session is finished: begin another one for more photos")
        added = photo if isinstance(photo, Skipped) else self._add(photo)
        self._report.add(added)
        if isinstance(added, Skipped):
            self.database.write_skipped(added, self._announcer.path_of(added.name))
            self._announcer.tell(added)
        else:
            self._is_idle = False
            self._retrieval_log.add(added)
            self._announcer.tell(added)
            placed = [self._catalog.image_id(name) for name in added.registered]
            self._announcer.tell_outcome(self._atlas, added.image_id, placed)
        if self._snapshots.is_due:
            self._snapshots.write(self._atlas.models, len(self._catalog), self._catalog.colors)
        return added

    def finish(self) -> SessionResult:
        """Place what can still be placed, refine, and export all models."""
        if self._finished:
            raise RuntimeError("the session is finished already")
        self._finished = True
        clock = Stopwatch()
        before = self._atlas.registered
        with clock.stage("finish"):
            finish(self._atlas)
        for image_id in sorted(self._atlas.registered - before):
            self._announcer.tell_placed(self._atlas, image_id)
        with clock.stage("export"):
            models = self._snapshots.write(
                self._atlas.models,
                len(self._catalog),
                self._catalog.colors,
                final=True,
                text=self.options.text,
            )
        summary = self._report.finish(
            models,
            {i: self._atlas.why_not_registered(i) for i in self._atlas.waiting},
            seconds=clock.seconds,
            events=(*self._idle_events, *self._announcer.pop_model_events()),
            latencies_s=self._announcer.latencies_s,
        )
        write_report(self.output, summary)
        mark_finished(self.database)
        totals = summary.totals
        self._announcer.tell(
            SessionEnded(True, totals.num_used, totals.num_registered, len(models))
        )
        return SessionResult(tuple(models), summary)

    def close(self) -> None:
        """End; without ``finish``, the same session can be gone on with."""
        self._opened.close()

    def _add(self, photo: ExtractedPhoto) -> PhotoAdded | Skipped:
        """The method: retrieve, re-rank, match and verify, store, map, remember."""
        clock = Stopwatch()
        view = self._catalog.admit(photo)
        if isinstance(view, Skipped):
            return view
        image_id = view.image_id
        with clock.stage("retrieve"):
            candidates = self._retriever.candidates(photo.global_vector)
        with clock.stage("rerank"):
            enough = self.options.pair_matching.num_matched
            ranked = self._reranker.rerank(view, candidates, self._catalog, enough=enough)
        pairs, rejected = self._pairs.match(
            view,
            ranked,
            self._catalog,
            locate=self._atlas.locate,
            poses_of=self._atlas.poses_of,
            clock=clock,
        )
        unranked = candidates[len(ranked) :]
        outcomes = self._outcomes([*ranked, *unranked], pairs, rejected)
        with clock.stage("store"):
            self.database.write(image_id, photo, view.camera, pairs, outcomes)
        with clock.stage("map"):
            keypoints = photo.features.keypoints
            self._view_graph.add(image_id, photo.name, view.camera, keypoints, pairs)
            registered = self._atlas.add(image_id)
        self._retriever.remember(image_id, photo.global_vector)
        events = self._announcer.pop_model_events()
        # Apart from the rest of mapping: it alone depends on how many photos came before.
        refinements = [event for event in events if isinstance(event, ModelRefined)]
        clock.move("map", "refine", sum(event.seconds for event in refinements))
        return PhotoAdded(
            name=photo.name,
            image_id=image_id,
            num_keypoints=len(photo.features),
            candidates=outcomes,
            registered=tuple(self._catalog.name(i) for i in registered),
            num_registered=len(self._atlas.registered),
            num_points=self._atlas.num_points,
            seconds={**photo.seconds, **clock.seconds},
            events=events,
        )

    def _outcomes(
        self,
        candidates: Iterable[RankedCandidate | Candidate],
        pairs: Iterable[PairGeometry],
        rejected: Mapping[int, Rejected],
    ) -> tuple[CandidateOutcome, ...]:
        verified = {pair.image_id2 for pair in pairs}
        return tuple(
            CandidateOutcome(
                self._catalog.name(candidate.image_id),
                candidate.cosine,
                candidate.inliers,
                candidate.image_id in verified,
                rejected.get(candidate.image_id),
            )
            for candidate in candidates
        )
