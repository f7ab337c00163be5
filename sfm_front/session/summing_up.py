"""What a session says of itself at its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sfm_front.events import ModelEvent
from sfm_front.mapping.audit import ModelAudit
from sfm_front.reports.camera_outcome import CameraOutcome, camera_outcomes
from sfm_front.reports.run_summary import GeoreferenceOutcome, RunSummary
from sfm_front.session.hints import hint
from sfm_front.session.options import SessionOptions
from sfm_front.session.parts import SessionParts
from sfm_front.types import ModelSummary


@dataclass(frozen=True, slots=True)
class SessionResult:
    """Finished models, the largest first, and what ``report.json`` says."""

    models: tuple[ModelSummary, ...]
    summary: RunSummary


def sum_up(
    parts: SessionParts,
    options: SessionOptions,
    models: Sequence[ModelSummary],
    *,
    audits: Sequence[ModelAudit],
    georeference: GeoreferenceOutcome | None,
    seconds: Mapping[str, float],
    events: Sequence[ModelEvent],
    latencies_s: Sequence[float],
) -> RunSummary:
    """``models`` as they were written, in the order of the atlas. See ``RunReport.finish``."""
    atlas = parts.atlas
    waiting = atlas.waiting
    return parts.report.finish(
        models,
        {image_id: atlas.why_not_registered(image_id) for image_id in waiting},
        {image_id: _hint(parts, options, image_id) for image_id in waiting},
        audits=audits,
        seconds=seconds,
        events=events,
        latencies_s=latencies_s,
        georeference=georeference,
        cameras=_cameras(parts, options, models),
    )


def _hint(parts: SessionParts, options: SessionOptions, image_id: int) -> str:
    nearest = parts.retriever.nearest(image_id, options.second_look.candidates)
    return hint(image_id, parts.atlas.view_graph, parts.atlas.registered, nearest)


def _cameras(
    parts: SessionParts, options: SessionOptions, models: Sequence[ModelSummary]
) -> list[CameraOutcome]:
    limit = options.atlas.mapper.calibration.max_focal_sigma
    first_cameras = parts.view_graph.cameras
    return [
        outcome
        for written, model in zip(models, parts.atlas.models, strict=True)
        for outcome in camera_outcomes(written, first_cameras, model.focal_sigmas, limit)
    ]
