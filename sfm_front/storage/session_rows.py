"""Rows of the tables beside COLMAP's: what a session needs to go on."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sfm_front.storage.photo_json import candidate_of_row, candidate_row, exif_of_row, exif_row
from sfm_front.storage.sqlite_file import Row
from sfm_front.types import (
    CandidateOutcome,
    ExtractedPhoto,
    FileState,
    PairGeometry,
    Skipped,
    SkipReason,
    StoredPhoto,
)

# COLMAP's tools pass over these tables.
TABLES = (
    "CREATE TABLE IF NOT EXISTS sfm_front_session (key TEXT PRIMARY KEY, value TEXT NOT NULL)",
    """CREATE TABLE IF NOT EXISTS sfm_front_photos (
    image_id INTEGER PRIMARY KEY NOT NULL, path BLOB NOT NULL, size INTEGER, mtime_ns INTEGER,
    width INTEGER NOT NULL, height INTEGER NOT NULL, digest TEXT NOT NULL, exif TEXT NOT NULL,
    global_vector BLOB NOT NULL, colors BLOB NOT NULL, candidates TEXT NOT NULL,
    seconds TEXT NOT NULL)""",
    """CREATE TABLE IF NOT EXISTS sfm_front_skipped (
    name TEXT PRIMARY KEY NOT NULL, path BLOB NOT NULL, size INTEGER, mtime_ns INTEGER,
    reason TEXT NOT NULL, detail TEXT NOT NULL)""",
    """CREATE TABLE IF NOT EXISTS sfm_front_pairs (
    number INTEGER PRIMARY KEY, later INTEGER NOT NULL, earlier INTEGER NOT NULL,
    tri_angle REAL)""",
    "CREATE INDEX IF NOT EXISTS sfm_front_pairs_by_photo ON sfm_front_pairs (later)",
)


def photo_row(image_id: int, photo: ExtractedPhoto, candidates: Sequence[CandidateOutcome]) -> Row:
    """What COLMAP's tables do not hold of a photo."""
    return Row(
        "sfm_front_photos",
        {
            "image_id": image_id,
            **_file(photo.path),
            "width": photo.width,
            "height": photo.height,
            "digest": photo.digest,
            "exif": json.dumps(exif_row(photo.exif)),
            "global_vector": photo.global_vector.tobytes(),
            "colors": photo.features.colors.tobytes(),
            "candidates": json.dumps([candidate_row(candidate) for candidate in candidates]),
            "seconds": json.dumps(photo.seconds),
        },
    )


PHOTO_COLUMNS = (
    "image_id, name, camera_id, path, size, mtime_ns, width, height, digest, exif, "
    "global_vector, candidates, seconds, keypoints.rows FROM sfm_front_photos "
    "JOIN images USING (image_id) JOIN keypoints USING (image_id)"
)
"""What ``read_photo`` takes, and the tables it comes from."""


def read_photo(row: tuple[Any, ...]) -> StoredPhoto:
    """The photo of a row of ``PHOTO_COLUMNS``."""
    return StoredPhoto(
        image_id=row[0],
        name=row[1],
        camera_id=row[2],
        file=FileState(Path(os.fsdecode(row[3])), row[4], row[5]),
        width=row[6],
        height=row[7],
        digest=row[8],
        exif=exif_of_row(json.loads(row[9])),
        global_vector=np.frombuffer(row[10], np.float32),
        candidates=tuple(map(candidate_of_row, json.loads(row[11]))),
        seconds=json.loads(row[12]),
        num_keypoints=row[13],
    )


def pair_row(pair: PairGeometry) -> Row:
    """Which photo of a pair came later, and its angle, for which COLMAP's table has no place."""
    tri_angle = pair.two_view_geometry.tri_angle
    values = {"later": pair.image_id1, "earlier": pair.image_id2, "tri_angle": tri_angle}
    return Row("sfm_front_pairs", values)


def skipped_row(skipped: Skipped, path: Path) -> Row:
    """A file that is not used."""
    reason, detail = skipped.reason.value, skipped.detail
    values = {"name": skipped.name, **_file(path), "reason": reason, "detail": detail}
    return Row("sfm_front_skipped", values)


SKIPPED_COLUMNS = "name, path, size, mtime_ns, reason, detail FROM sfm_front_skipped"
"""What ``read_skipped`` takes, and the table it comes from."""


def read_skipped(row: tuple[Any, ...]) -> tuple[Skipped, FileState]:
    """The file of a row of ``SKIPPED_COLUMNS``, and its state then."""
    name, path, size, mtime_ns, reason, detail = row
    skipped = Skipped(name, SkipReason(reason), detail)
    return skipped, FileState(Path(os.fsdecode(path)), size, mtime_ns)


def _file(path: Path) -> dict[str, Any]:
    """Where a file is, and its state now; None if it is gone."""
    state = FileState.of(path.absolute())
    return {"path": os.fsencode(state.path), "size": state.size, "mtime_ns": state.mtime_ns}
