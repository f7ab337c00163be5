"""One photo's path: describe, retrieve, verify, store, map, remember."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from sfm_front.exporters.colmap import export_models
from sfm_front.features.extraction import FeatureExtraction, make_extractor
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor, resolve
from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.finishing import finish
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.matching.guided_matching import GuidedMatcher
from sfm_front.matching.matcher import make_matcher
from sfm_front.matching.verification import Verifier
from sfm_front.photos.reader import PhotoReader
from sfm_front.reports.run_report import Report
from sfm_front.retrieval.rerank import Reranker
from sfm_front.retrieval.retriever import Retriever
from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.devices import usable_device
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.session.catalog import PhotoCatalog
from sfm_front.session.options import SessionOptions
from sfm_front.session.output_folder import check_output_folder, make_output_folder
from sfm_front.session.pair_matching import CandidateMatcher
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import (
    ExtractedPhoto,
    ModelSummary,
    PhotoPath,
    Skipped,
    StepReport,
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
            self.options.global_descriptor,
            weights=self.options.weights,
            vlad_weight=self.options.vlad_weight,
            device=device,
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
            make_extractor(device, self.options.sift),
            descriptor,
            num_threads=threads,
        )
        opened.callback(self._describer.close)
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
        self._catalog = PhotoCatalog(self.options.cameras)
        self._database = PhotoDatabase(output / "database.db")
        opened.callback(self._database.close)
        self._view_graph = ViewGraph()
        self._atlas = Atlas(self._view_graph, self.options.atlas)
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
            finish(self._atlas)
        with clock.stage("export"):
            models = export_models(
                [model.reconstruction for model in self._atlas.models],
                {image_id: view.features.colors for image_id, view in self._catalog.items()},
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
        """The method: retrieve, re-rank, match and verify, store, map, remember."""
        clock = Stopwatch()
        view = self._catalog.admit(photo)
        if isinstance(view, Skipped):
            return StepReport(photo.name, skipped=view)
        image_id = view.image_id
        with clock.stage("retrieve"):
            candidates = self._retriever.candidates(photo.global_vector)
        with clock.stage("rerank"):
            enough = self.options.pair_matching.num_matched
            candidates = self._reranker.rerank(view, candidates, self._catalog, enough=enough)
        pairs, rejected = self._pairs.match(
            view,
            candidates,
            self._catalog,
            locate=self._atlas.locate,
            poses_of=self._atlas.poses_of,
            clock=clock,
        )
        with clock.stage("store"):
            self._database.write(image_id, photo, view.camera, pairs)
        with clock.stage("map"):
            keypoints = photo.features.keypoints
            self._view_graph.add(image_id, photo.name, view.camera, keypoints, pairs)
            registered = self._atlas.add(image_id)
        # Apart from the rest of mapping: it alone depends on how many photos came before.
        clock.move("map", "refine", self._atlas.take_refinement_seconds())
        self._retriever.remember(image_id, photo.global_vector)
        name = self._catalog.name
        return StepReport(
            name=photo.name,
            image_id=image_id,
            # Reports are kept to the end; what was matched is in the database.
            candidates=tuple(replace(candidate, matches=None) for candidate in candidates),
            most_relevant=name(candidates[0].image_id) if candidates else None,
            num_keypoints=len(photo.features),
            verified=tuple(name(pair.image_id2) for pair in pairs),
            rejected=tuple(rejected),
            registered=tuple(name(i) for i in registered),
            num_registered=len(self._atlas.registered),
            num_points=self._atlas.num_points,
            seconds={**photo.seconds, **clock.seconds},
            events=self._atlas.take_events(),
        )
