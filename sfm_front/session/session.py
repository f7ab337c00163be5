"""One photo's path: describe, retrieve, verify, store, map, remember."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from sfm_front.exporters.colmap import export_models
from sfm_front.features.extraction import FeatureExtraction, make_extractor
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor, resolve
from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.matching.guided_matching import GuidedMatcher
from sfm_front.matching.matcher import make_matcher
from sfm_front.matching.verification import Verifier, View
from sfm_front.photos.cameras import CameraCatalog
from sfm_front.photos.reader import DuplicateFinder, PhotoReader
from sfm_front.photos.source import PhotoPath
from sfm_front.reports.run_report import Report
from sfm_front.retrieval.rerank import Reranker
from sfm_front.retrieval.retriever import Retriever
from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.devices import usable_device
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.session.options import SessionOptions
from sfm_front.session.output_folder import check_output_folder, make_output_folder
from sfm_front.session.pair_matching import CandidateMatcher
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import (
    Candidate,
    ExtractedPhoto,
    ModelSummary,
    PairGeometry,
    Rejection,
    Skipped,
    StepReport,
    Uint32Array,
)


class Session(Closeable):
    """Reconstructs photos that arrive one at a time.

    ::

        with Session(Path("outputs/flight")) as session:
            for path in paths:
                print(session.add(path).registered)
            models = session.finish()

    ``output`` receives ``database.db``, ``retrieval.jsonl``, ``report.json`` and ``sparse/``.
    """

    def __init__(
        self, output: Path, options: SessionOptions | None = None, *, overwrite: bool = False
    ) -> None:
        """``overwrite`` removes what an earlier session wrote to ``output``, and nothing else.

        Raises InputError if there is such a session and it may not be overwritten; ConfigError,
        WeightsError or DependencyError if the global descriptor cannot be had. Nothing has been
        written or removed then.
        """
        self.options = options or SessionOptions()
        self.output = output
        check_output_folder(output, overwrite=overwrite)
        device, on_device = usable_device(self.options.device)
        descriptor, on_descriptor = resolve(
            self.options.global_descriptor, weights=self.options.weights, device=device
        )
        self.messages = tuple(line for line in (on_device, on_descriptor) if line)
        make_output_folder(output, overwrite=overwrite)
        # What is open is closed again if a later part cannot be made.
        with ExitStack() as opened:
            self._open(opened, device, descriptor)
            self._opened = opened.pop_all()
        self._finished = False

    def _open(self, opened: ExitStack, device: str, descriptor: GlobalDescriptor) -> None:
        output, threads = self.output, self.options.threads
        self._describer = FeatureExtraction(
            PhotoReader(max_image_size=self.options.max_image_size),
            make_extractor(device, self.options.max_features),
            descriptor,
            num_threads=threads,
        )
        opened.callback(self._describer.close)
        self._workers = WorkerPool(threads)
        opened.callback(self._workers.close)
        self._verifier = Verifier(self.options.verification)
        matcher = make_matcher(device, self.options.matching, self._workers)
        self._reranker, second_rerank = (
            Reranker(options, matcher, self._verifier, self._workers)
            for options in (self.options.rerank, self.options.second_rerank)
        )
        self._retriever = Retriever(self.options.retrieval, descriptor.dimension)
        self._pairing = CandidateMatcher(matcher, second_rerank)
        self._guided = GuidedMatcher(
            self.options.guided, self.options.matching, self.options.verification, self._workers
        )
        self._duplicates = DuplicateFinder()
        self._cameras = CameraCatalog(self.options.cameras)
        self._database = PhotoDatabase(output / "database.db")
        opened.callback(self._database.close)
        self._view_graph = ViewGraph()
        self._atlas = Atlas(self._view_graph, self.options.atlas)
        self._views: dict[int, View] = {}
        self._names: dict[int, str] = {}
        self._report = Report(output)
        opened.callback(self._report.close)

    def add(self, path: Path, name: str | None = None) -> StepReport:
        """Take in one photo; ``name`` is what it is called in the models (default: the file's)."""
        return self.add_extracted(self._describer.describe(PhotoPath(name or path.name, path)))

    def add_all(self, photos: Iterable[PhotoPath]) -> Iterator[StepReport]:
        """Take in photos in order, the next ones described while one is matched and mapped."""
        for described in self._describer.stream(photos):
            yield self.add_extracted(described)

    def add_extracted(self, photo: ExtractedPhoto | Skipped) -> StepReport:
        """Take in a photo whose features are extracted already.

        Raises RuntimeError once the session is finished: its models are final.
        """
        if self._finished:
            raise RuntimeError("the session is finished: begin another one for more photos")
        if isinstance(photo, ExtractedPhoto):
            photo = self._duplicates.check(photo.name, photo.digest) or photo
        if isinstance(photo, Skipped):
            step = StepReport(photo.name, skipped=photo)
        else:
            step = self._place(photo)
        self._report.add(step)
        return step

    def finish(self) -> list[ModelSummary]:
        """Place what can still be placed, refine, and export all models, the largest first."""
        if self._finished:
            raise RuntimeError("the session is finished already")
        self._finished = True
        clock = Stopwatch()
        with clock.stage("finish"):
            self._atlas.finish()
        with clock.stage("export"):
            models = export_models(
                [model.reconstruction for model in self._atlas.models],
                {image_id: view.features.colors for image_id, view in self._views.items()},
                self.output / "sparse",
                text=self.options.text,
            )
        self.report = self._report.finish(
            models,
            {i: self._atlas.why_not_registered(i) for i in self._atlas.waiting},
            seconds=clock.seconds,
            events=self._atlas.take_events(),
        )
        return models

    def close(self) -> None:
        self._opened.close()

    def _place(self, photo: ExtractedPhoto) -> StepReport:
        """The method: retrieve, verify, store, map, remember."""
        clock = Stopwatch()
        image_id = len(self._views) + 1
        camera = self._cameras.camera_for(photo).camera
        view = View(image_id, camera, photo.features)
        with clock.stage("retrieve"):
            candidates = self._retriever.candidates(photo.global_vector)
        with clock.stage("rerank"):
            candidates = self._reranker.rerank(
                view, candidates, self._views, enough=self.options.num_matched
            )
        pairs = self._match(view, candidates[: self.options.num_matched_first], clock)
        if further := candidates[self.options.num_matched_first : self.options.num_matched]:
            pairs += self._match_guided(view, further, pairs, clock)
        with clock.stage("store"):
            self._database.write(image_id, photo, camera, pairs)
        with clock.stage("map"):
            self._view_graph.add(image_id, photo.name, camera, photo.features.keypoints, pairs)
            registered = self._atlas.add(image_id)
        # Apart from the rest of mapping: it alone depends on how many photos came before.
        clock.move("map", "refine", self._atlas.take_refinement_seconds())
        self._retriever.remember(image_id, photo.global_vector)
        self._views[image_id] = view
        self._names[image_id] = photo.name
        return StepReport(
            name=photo.name,
            image_id=image_id,
            # Reports are kept to the end; what was matched is in the database.
            candidates=tuple(replace(candidate, matches=None) for candidate in candidates),
            most_relevant=self._names[candidates[0].image_id] if candidates else None,
            num_keypoints=len(photo.features),
            verified=tuple(self._names[pair.image_id2] for pair in pairs),
            registered=tuple(self._names[i] for i in registered),
            num_registered=len(self._atlas.registered),
            num_points=self._atlas.num_points,
            seconds={**photo.seconds, **clock.seconds},
            events=self._atlas.take_events(),
        )

    def _match(
        self, view: View, candidates: Sequence[Candidate], clock: Stopwatch
    ) -> list[PairGeometry]:
        """Match a photo with candidates on all features; keep the verified pairs."""

        def verify_with(tentative: tuple[View, Uint32Array]) -> PairGeometry | Rejection:
            return self._verifier.verify(view, *tentative)

        with clock.stage("match"):
            matches = self._pairing.match(view, candidates, self._views)
        with clock.stage("verify"):
            verified = self._workers.map(verify_with, matches)
        return [pair for pair in verified if isinstance(pair, PairGeometry)]

    def _match_guided(
        self,
        view: View,
        candidates: Sequence[Candidate],
        pairs: Sequence[PairGeometry],
        clock: Stopwatch,
    ) -> list[PairGeometry]:
        """Match with further candidates where the pose that follows from the pairs has them.

        Candidates without a known pose are matched unguided.
        """
        with clock.stage("locate"):
            posed = self._atlas.locate(view.camera.camera_id, view.features.keypoints, pairs)
        guided: list[PairGeometry] = []
        if posed is not None:
            with clock.stage("guide"):
                others = self._atlas.poses_of(candidate.image_id for candidate in candidates)
                guided = self._guided.match(view, posed, candidates, self._views, others)
        found = {pair.image_id2 for pair in guided}
        left = [candidate for candidate in candidates if candidate.image_id not in found]
        return guided + self._match(view, left, clock)
