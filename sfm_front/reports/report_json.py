"""``report.json``: a run summary as JSON, written and read back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sfm_front.errors import InputError
from sfm_front.georeference.sidecar import as_row, of_row
from sfm_front.reports.camera_outcome import camera_rows, cameras_from_rows
from sfm_front.reports.cluster_outcome import cluster_of_row, cluster_row
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
from sfm_front.storage.json_files import write_json
from sfm_front.types import Skipped, SkipReason, WaitingReason

FILE = "report.json"

# Raised when a key changes its meaning or goes; new keys leave it as it is.
VERSION = 1


def write_report(output: Path, summary: RunSummary) -> None:
    """Write ``report.json`` to the folder ``output``. Raises InputError if that fails."""
    write_json(output / FILE, as_content(summary))


def as_content(summary: RunSummary) -> dict[str, Any]:
    """Ready for JSON."""
    totals = summary.totals
    return {
        "version": VERSION,
        "photos": [_row(photo) for photo in summary.photos],
        "models": [
            {
                "path": model.path,
                "registered": model.num_registered,
                "points3D": model.num_points,
                "mean_reprojection_error_px": round(model.mean_reprojection_error_px, 4),
                "mean_track_length": round(model.mean_track_length, 3),
                "audit": _audit_row(model.audit),
            }
            for model in summary.models
        ],
        "end": {"seconds": _rounded(summary.end_seconds), "events": summary.end_events},
        "look_alikes": summary.look_alikes,
        "georeference": _georeference_row(summary.georeference),
        "cameras": camera_rows(summary.cameras),
        "cluster": cluster_row(summary.cluster),
        "totals": {
            "photos": totals.num_photos,
            "used": totals.num_used,
            "skipped": totals.num_photos - totals.num_used,
            "registered": totals.num_registered,
            "models": len(summary.models),
            "points3D": totals.num_points,
            "mean_reprojection_error_px": (
                None
                if totals.mean_reprojection_error_px is None
                else round(totals.mean_reprojection_error_px, 4)
            ),
            "wall_seconds": round(totals.wall_seconds, 3),
            "seconds_by_stage": _rounded(totals.seconds_by_stage),
            "median_seconds_by_quarter": [round(s, 4) for s in totals.median_seconds_by_quarter],
            "peak_memory_bytes": totals.peak_memory_bytes,
            "latency_seconds": _latency_row(totals.latency),
        },
    }


def read_report(output: Path) -> RunSummary:
    """Read it back. Raises InputError if ``output`` holds none, or one that cannot be read."""
    try:
        content = json.loads((output / FILE).read_text(encoding="utf-8"))
        return _summary(content)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{output}: no readable {FILE} in it. Give the output of a finished run; the "
            "command of one that was interrupted goes on where it stopped."
        ) from error


def _row(photo: Outcome) -> dict[str, Any]:
    if isinstance(photo, Skipped):
        return {
            "name": photo.name,
            "image_id": None,
            "skipped": {"reason": photo.reason.value, "detail": photo.detail},
            "registered": False,
            "model": None,
        }
    return {
        "name": photo.name,
        "image_id": photo.image_id,
        "skipped": None,
        "registered": photo.model is not None,
        "model": photo.model,
        "why_not_registered": photo.why_not,
        "waiting": photo.waiting and photo.waiting.value,
        "what_would_help": photo.hint,
        "keypoints": photo.num_keypoints,
        "most_relevant": photo.most_relevant,
        "verified_pairs": photo.num_verified,
        "rejected_pairs": photo.num_rejected,
        "placed_by_this_step": photo.placed,
        "seconds": _rounded(photo.seconds),
        "events": photo.events,
    }


def _latency_row(latency: Latency | None) -> dict[str, float] | None:
    if latency is None:
        return None
    return _rounded({"median": latency.median_s, "p95": latency.p95_s, "worst": latency.worst_s})


def _georeference_row(outcome: GeoreferenceOutcome | None) -> dict[str, Any] | None:
    if outcome is None:
        return None
    return {
        "unused_rows": outcome.num_unused_rows,
        "kept_positions": outcome.kept_positions,
        "sidecar": outcome.sidecar and as_row(outcome.sidecar),
    }


def _audit_row(audit: AuditOutcome | None) -> dict[str, Any] | None:
    if audit is None:
        return None
    return {
        "pairs": audit.num_pairs,
        "contradicted": audit.num_contradicted,
        "contradicted_share": round(audit.contradicted_share, 4),
        "doubtful": audit.is_doubtful,
        "worst_groups": audit.worst_groups,
        "worst_share": round(audit.worst_share, 4),
    }


def _rounded(seconds: dict[str, float]) -> dict[str, float]:
    return {stage: round(value, 4) for stage, value in seconds.items()}


def _summary(content: dict[str, Any]) -> RunSummary:
    totals = content["totals"]
    return RunSummary(
        photos=tuple(_outcome(row) for row in content["photos"]),
        models=tuple(
            ModelOutcome(
                model["path"],
                model["registered"],
                model["points3D"],
                model["mean_reprojection_error_px"],
                model["mean_track_length"],
                _audit(model.get("audit")),  # absent in reports of earlier versions
            )
            for model in content["models"]
        ),
        end_seconds=content["end"]["seconds"],
        end_events=tuple(content["end"]["events"]),
        totals=Totals(
            num_photos=totals["photos"],
            num_used=totals["used"],
            num_registered=totals["registered"],
            num_points=totals["points3D"],
            mean_reprojection_error_px=totals["mean_reprojection_error_px"],
            wall_seconds=totals["wall_seconds"],
            seconds_by_stage=totals["seconds_by_stage"],
            median_seconds_by_quarter=tuple(totals["median_seconds_by_quarter"]),
            peak_memory_bytes=totals["peak_memory_bytes"],
            latency=_latency(
                totals.get("latency_seconds")
            ),  # absent in reports of earlier versions
        ),
        look_alikes=tuple(
            tuple(tuple(group) for group in groups)
            for groups in content.get("look_alikes", ())  # absent in reports of earlier versions
        ),
        georeference=_georeference(content.get("georeference")),  # absent in earlier versions
        cameras=cameras_from_rows(content.get("cameras", ())),  # absent in earlier versions
        cluster=cluster_of_row(content.get("cluster")),  # absent in earlier versions
    )


def _georeference(row: dict[str, Any] | None) -> GeoreferenceOutcome | None:
    if row is None:
        return None
    return GeoreferenceOutcome(
        sidecar=row["sidecar"] and of_row(row["sidecar"]),
        num_unused_rows=row["unused_rows"],
        kept_positions=row["kept_positions"],
    )


def _latency(row: dict[str, float] | None) -> Latency | None:
    return None if row is None else Latency(row["median"], row["p95"], row["worst"])


def _audit(row: dict[str, Any] | None) -> AuditOutcome | None:
    if row is None:
        return None
    return AuditOutcome(
        row["pairs"],
        row["contradicted"],
        row["contradicted_share"],
        row["doubtful"],
        tuple(map(tuple, row["worst_groups"])),
        row["worst_share"],
    )


def _outcome(row: dict[str, Any]) -> Outcome:
    if row["skipped"]:
        return Skipped(row["name"], SkipReason(row["skipped"]["reason"]), row["skipped"]["detail"])
    return PhotoOutcome(
        name=row["name"],
        image_id=row["image_id"],
        model=row["model"],
        why_not=row["why_not_registered"],
        num_keypoints=row["keypoints"],
        most_relevant=row["most_relevant"],
        num_verified=row["verified_pairs"],
        num_rejected=row.get("rejected_pairs", 0),  # absent in reports of earlier versions
        placed=tuple(row["placed_by_this_step"]),
        seconds=row["seconds"],
        events=tuple(row["events"]),
        hint=row.get("what_would_help", ""),  # absent in reports of earlier versions
        # The same, and of photos in a model.
        waiting=WaitingReason(row["waiting"]) if row.get("waiting") else None,
    )
