"""What is known of a photo as JSON: its EXIF, and what became of its candidates."""

from __future__ import annotations

from dataclasses import astuple
from datetime import datetime
from typing import Any

from sfm_front.types import (
    CandidateOutcome,
    Exif,
    GeoPosition,
    GimbalAngles,
    Rejected,
    Rejection,
)


def exif_row(exif: Exif) -> dict[str, Any]:
    """EXIF as JSON has it."""
    return {
        "make": exif.make,
        "model": exif.model,
        "focal_length_mm": exif.focal_length_mm,
        "focal_length_35mm": exif.focal_length_35mm,
        "captured_at": exif.captured_at and exif.captured_at.isoformat(),
        "position": exif.position and list(astuple(exif.position)),
        "orientation": exif.orientation,
        "gimbal": exif.gimbal and list(astuple(exif.gimbal)),
    }


def exif_of_row(row: dict[str, Any]) -> Exif:
    """Back from ``exif_row``."""
    captured_at, position = row["captured_at"], row["position"]
    gimbal = row.get("gimbal")  # absent in files of earlier versions, as are the sigmas
    return Exif(
        **{
            **row,
            "captured_at": captured_at and datetime.fromisoformat(captured_at),
            "position": position and GeoPosition(*position),
            "gimbal": gimbal and GimbalAngles(*gimbal),
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
