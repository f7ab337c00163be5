"""What is known of a photo as JSON: its EXIF, and what became of its candidates."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sfm_front.types import CandidateOutcome, Exif, GeoPosition, Rejected, Rejection


def exif_row(exif: Exif) -> dict[str, Any]:
    """EXIF as JSON has it."""
    position = exif.position
    return {
        "make": exif.make,
        "model": exif.model,
        "focal_length_mm": exif.focal_length_mm,
        "focal_length_35mm": exif.focal_length_35mm,
        "captured_at": exif.captured_at and exif.captured_at.isoformat(),
        "position": position
        and [position.latitude_deg, position.longitude_deg, position.altitude_m],
        "orientation": exif.orientation,
    }


def exif_of_row(row: dict[str, Any]) -> Exif:
    """Back from ``exif_row``."""
    captured_at, position = row["captured_at"], row["position"]
    return Exif(
        **{
            **row,
            "captured_at": captured_at and datetime.fromisoformat(captured_at),
            "position": position and GeoPosition(*position),
        }
    )


def candidate_row(candidate: CandidateOutcome) -> dict[str, Any]:
    """A candidate as ``retrieval.jsonl`` has it."""
    why = candidate.rejected
    return {
        "name": candidate.name,
        "cosine": round(candidate.cosine, 5),
        "inliers": candidate.inliers,
        "verified": candidate.verified,
        "rejected": why
        and {
            "reason": why.reason.value,
            "matches": why.num_matches,
            "inliers": why.num_inliers,
        },
    }


def candidate_of_row(row: dict[str, Any]) -> CandidateOutcome:
    """Back from ``candidate_row``."""
    why = row.get("rejected")  # absent in files of earlier versions
    return CandidateOutcome(
        row["name"],
        row["cosine"],
        row["inliers"],
        row["verified"],
        why and Rejected(Rejection(why["reason"]), why["matches"], why["inliers"]),
    )
