"""Collects what happens in a session and sums it up at the end."""

from __future__ import annotations

import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import pycolmap

from sfm_front.events import (
    PREFETCHED_STAGES,
    LookAlikesRefused,
    ModelEvent,
    ModelRefined,
    PhotoAdded,
)
from sfm_front.mapping.audit import ModelAudit
from sfm_front.reports.camera_outcome import CameraOutcome
from sfm_front.reports.cluster_outcome import ClusterOutcome
from sfm_front.reports.run_summary import (
    AuditOutcome,
    GeoreferenceOutcome,
    Latency,
    ModelOutcome,
    Outcome,
    PhotoOutcome,
    RunSummary,
    Totals,
)
from sfm_front.types import ModelSummary, Skipped, Waiting


class RunReport:
    """What became of each photo so far."""

    def __init__(self) -> None:
        self._started = time.perf_counter()
        self._photos: list[Skipped | PhotoAdded] = []
        self._restored: set[int] = set()
        self._skipped: dict[str, Skipped] = {}
        self.cluster: ClusterOutcome | None = None

    def add(self, photo: Skipped | PhotoAdded) -> None:
        """Note a photo. One that was skipped, cut off perhaps, and comes again counts once."""
        if photo.name in self._skipped:
            self._photos.remove(self._skipped.pop(photo.name))
        if isinstance(photo, Skipped):
            self._skipped[photo.name] = photo
        self._photos.append(photo)

    def restore(self, photo: PhotoAdded) -> None:
        """Note a photo of an earlier run."""
        self._restored.add(photo.image_id)
        self._photos.append(photo)

    def finish(
        self,
        models: Sequence[ModelSummary],
        why_not: Mapping[int, Waiting],
        hints: Mapping[int, str],
        *,
        audits: Sequence[ModelAudit],
        seconds: Mapping[str, float],
        events: Sequence[ModelEvent],
        latencies_s: Sequence[float],
        georeference: GeoreferenceOutcome | None = None,
        cameras: Sequence[CameraOutcome] = (),
    ) -> RunSummary:
        """Sum up.

        ``why_not``: image id → why it is in no model, ``hints``: what would help. ``audits``: one
        for each model. ``seconds`` by stage and ``events`` of the end and of idle times.
        ``latencies_s``: from arrival to pose, of each photo of this run that was placed.
        """
        model_of = {
            image_id: number
            for number, model in reversed(list(enumerate(models)))
            for image_id in model.reconstruction.reg_image_ids()
        }
        return RunSummary(
            photos=tuple(_outcome(photo, model_of, why_not, hints) for photo in self._photos),
            models=tuple(
                ModelOutcome(
                    model.path_in_output,
                    model.num_registered,
                    model.num_points,
                    model.mean_reprojection_error_px,
                    model.mean_track_length,
                    _audit_outcome(audit, model.reconstruction),
                )
                for model, audit in zip(models, audits, strict=True)
            ),
            end_seconds=dict(seconds),
            end_events=_in_words(events),
            totals=self._totals(models, len(model_of), seconds, latencies_s),
            look_alikes=self._look_alikes(events),
            georeference=georeference,
            cameras=tuple(cameras),
            cluster=self.cluster,
        )

    def _look_alikes(self, events: Iterable[ModelEvent]) -> tuple[tuple[tuple[str, ...], ...], ...]:
        names = {
            photo.image_id: photo.name for photo in self._photos if isinstance(photo, PhotoAdded)
        }
        return tuple(
            tuple(tuple(names[image_id] for image_id in group) for group in event.image_ids)
            for event in events
            if isinstance(event, LookAlikesRefused)
        )

    def _totals(
        self,
        models: Sequence[ModelSummary],
        num_registered: int,
        seconds: Mapping[str, float],
        latencies_s: Sequence[float],
    ) -> Totals:
        used = [photo for photo in self._photos if isinstance(photo, PhotoAdded)]
        by_stage: Counter[str] = Counter(dict(seconds))
        for photo in used:
            by_stage.update(photo.seconds)
        points = sum(model.num_points for model in models)
        error = sum(model.mean_reprojection_error_px * model.num_points for model in models)
        return Totals(
            num_photos=len(self._photos),
            num_used=len(used),
            num_registered=num_registered,
            num_points=points,
            mean_reprojection_error_px=error / points if points else None,
            wall_seconds=time.perf_counter() - self._started,
            seconds_by_stage=dict(by_stage),
            median_seconds_by_quarter=_median_seconds_by_quarter(
                [photo for photo in used if photo.image_id not in self._restored]
            ),
            peak_memory_bytes=_peak_memory_bytes(),
            latency=Latency.of(latencies_s),
        )


def _audit_outcome(audit: ModelAudit, reconstruction: pycolmap.Reconstruction) -> AuditOutcome:
    return AuditOutcome(
        num_pairs=audit.num_pairs,
        num_contradicted=audit.num_contradicted,
        contradicted_share=audit.contradicted_share,
        is_doubtful=audit.is_doubtful,
        worst_groups=tuple(
            tuple(sorted(reconstruction.image(image_id).name for image_id in part))
            for part in audit.worst_parts or ()
        ),
        worst_share=audit.worst_share,
    )


def _outcome(
    photo: Skipped | PhotoAdded,
    model_of: Mapping[int, int],
    why_not: Mapping[int, Waiting],
    hints: Mapping[int, str],
) -> Outcome:
    if isinstance(photo, Skipped):
        return photo
    why = why_not.get(photo.image_id)
    return PhotoOutcome(
        name=photo.name,
        image_id=photo.image_id,
        model=model_of.get(photo.image_id),
        why_not=None if why is None else str(why),
        waiting=None if why is None else why.reason,
        num_keypoints=photo.num_keypoints,
        most_relevant=photo.most_relevant,
        num_verified=len(photo.verified),
        num_rejected=sum(candidate.rejected is not None for candidate in photo.candidates),
        placed=photo.registered,
        seconds=photo.seconds,
        events=_in_words(photo.events),
        hint=hints.get(photo.image_id, ""),
    )


def _in_words(events: Iterable[ModelEvent]) -> tuple[str, ...]:
    """Without refinements: each photo's seconds have those."""
    return tuple(str(event) for event in events if not isinstance(event, ModelRefined))


def _median_seconds_by_quarter(photos: Sequence[PhotoAdded]) -> tuple[float, ...]:
    """Work on a photo in its turn by quarter of the session, global refinement apart.

    It should not grow once there are as many photos as candidates. What runs ahead is left out:
    beside a growing model it waits longer for the processor.
    """
    left_out = PREFETCHED_STAGES | {"refine"}
    work = [
        sum(seconds for stage, seconds in photo.seconds.items() if stage not in left_out)
        for photo in photos
    ]
    bounds = [len(work) * quarter // 4 for quarter in range(5)]
    return tuple(
        statistics.median(work[start:end]) for start, end in pairwise(bounds) if end > start
    )


def _peak_memory_bytes() -> int | None:
    """None on systems that do not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    return peak if sys.platform == "darwin" else peak * 1024
