"""The parts a session is made of, and their state when it goes on where an earlier run stopped."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from sfm_front.events import PhotoAdded
from sfm_front.features.extraction import FeatureExtraction, make_extractor
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.mapping.atlas import Atlas
from sfm_front.mapping.background_refinement import BackgroundAdjuster
from sfm_front.mapping.restart import Restart
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.photos.cameras import CameraCatalog
from sfm_front.photos.positions import OFF
from sfm_front.photos.reader import PhotoReader
from sfm_front.reports.event_log import EventLog
from sfm_front.reports.run_report import RunReport
from sfm_front.retrieval.rerank import Reranker
from sfm_front.retrieval.retriever import Retriever
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.session.announcer import Announcer
from sfm_front.session.catalog import PhotoCatalog
from sfm_front.session.control_points import ControlPoints
from sfm_front.session.georeferencing import Georeferencing
from sfm_front.session.matching_parts import make_matching
from sfm_front.session.options import SessionOptions
from sfm_front.session.pair_matching import CandidateMatcher
from sfm_front.session.photo_folders import PhotoFolders
from sfm_front.session.photo_positions import PhotoPositions
from sfm_front.session.second_look import SecondLook
from sfm_front.session.snapshots import Snapshot
from sfm_front.storage.database import DATABASE, PhotoDatabase


@dataclass(frozen=True)
class SessionParts:
    """Each does one step of the method, or remembers something for the next photo."""

    extraction: FeatureExtraction
    retriever: Retriever
    reranker: Reranker
    pairs: CandidateMatcher
    database: PhotoDatabase
    catalog: PhotoCatalog
    view_graph: ViewGraph
    atlas: Atlas
    restart: Restart
    second_look: SecondLook
    positions: PhotoPositions
    georeferencing: Georeferencing
    control_points: ControlPoints
    report: RunReport


def open_parts(
    opened: ExitStack,
    output: Path,
    options: SessionOptions,
    device: str,
    descriptor: GlobalDescriptor,
    positions: PhotoPositions,
    control_points: ControlPoints,
    announcer: Announcer,
) -> SessionParts:
    """Make all parts; ``opened`` closes those that hold threads, processes or files."""
    threads = options.threads
    extraction = opened.enter_context(
        FeatureExtraction(
            PhotoReader(max_image_size=options.max_image_size),
            make_extractor(device, options.sift),
            descriptor,
            num_threads=threads,
        )
    )
    workers = opened.enter_context(WorkerPool(threads))
    matching = make_matching(options, device, workers)
    database = opened.enter_context(PhotoDatabase(output / DATABASE))
    # With one thread a session is the same to the bit each time: nothing runs beside it.
    adjuster = opened.enter_context(BackgroundAdjuster()) if threads > 1 else None
    cameras = CameraCatalog(options.cameras, PhotoFolders(database).folder_of)
    catalog = PhotoCatalog(cameras, database.features, options.cache_bytes)
    retriever = Retriever(options.retrieval, descriptor.dimension)
    view_graph = ViewGraph()
    atlas = Atlas(view_graph, options.atlas, announcer.tell_of_model, adjuster)
    second_look = SecondLook(
        options.second_look,
        retriever,
        matching.matcher,
        matching.verifier,
        workers,
        catalog,
        database,
        atlas,
        announcer.tell_of_model,
    )
    return SessionParts(
        extraction=extraction,
        retriever=retriever,
        reranker=matching.reranker,
        pairs=matching.pairs,
        database=database,
        catalog=catalog,
        view_graph=view_graph,
        atlas=atlas,
        restart=Restart(atlas),
        second_look=second_look,
        positions=positions,
        georeferencing=Georeferencing(
            positions,
            announcer.tell_of_model,
            seed=options.seed,
            is_on=options.georegister != OFF,
        ),
        control_points=control_points,
        report=RunReport(),
    )


def restore(
    parts: SessionParts,
    snapshot: Snapshot | None,
    announcer: Announcer,
    log: EventLog,
    *,
    grow: bool = True,
) -> None:
    """Go on with the photos in the database: models from the snapshot, what came after it anew,
    unless somebody else is to ``grow`` models of it. The ``log`` is made to acknowledge them all.
    """
    database, atlas = parts.database, parts.atlas
    for skipped, _ in database.skipped():
        parts.report.add(skipped)
    num_mapped = 0
    if snapshot is not None and snapshot.num_photos <= database.num_photos():
        num_mapped = snapshot.num_photos
    cameras = database.cameras()
    for photo in database.photos():
        image_id, camera = photo.image_id, cameras[photo.camera_id]
        keypoints, colors = database.keypoints(image_id)
        parts.catalog.restore(photo, camera, colors)
        parts.positions.take(image_id, photo.name, photo.exif)
        parts.control_points.take(photo.name, (photo.width, photo.height))
        parts.retriever.remember(image_id, photo.global_vector)
        added = PhotoAdded.restored(photo)
        parts.report.restore(added)
        pairs = database.pairs(image_id)
        parts.view_graph.add(image_id, photo.name, camera, keypoints, pairs)
        parts.second_look.note(image_id, (pair.image_id2 for pair in pairs))
        placed: list[int] | None = None
        if snapshot is not None and image_id == num_mapped:
            atlas.restore(snapshot.models)
            if snapshot.georeferencing is not None:
                parts.georeferencing.restore(snapshot.georeferencing)
        elif image_id > num_mapped and not grow:
            atlas.know(image_id)
        elif image_id > num_mapped:
            placed = atlas.add(image_id)
            parts.georeferencing.follow(atlas.models)
        if log.lacks(image_id):
            log.write(
                replace(
                    added,
                    registered=tuple(map(parts.catalog.name, placed or ())),
                    num_registered=len(atlas.registered),
                    num_points=atlas.num_points,
                )
            )
        if placed is not None:
            announcer.tell_outcome(atlas, image_id, placed)
    # Of earlier photos, whose reports are written.
    announcer.pop_model_events()
