"""What a report needs of a session's database, read without writing to it."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.storage.colmap_rows import CAMERA_COLUMNS, read_camera
from sfm_front.storage.session_photos import read_only, stored_photos
from sfm_front.storage.session_rows import SKIPPED_COLUMNS, read_skipped
from sfm_front.types import GeoPosition, Skipped, StoredPhoto


@dataclass(frozen=True, slots=True, eq=False)
class StoredSession:
    """``photos`` in order of arrival; ``unused``: files that are not, and ``skipped``: where these
    were, by name.

    ``cameras``: as photos started with them, by id. ``pairs`` (P, 3): image ids and the number of
    inliers of each verified pair; ``num_matched``: keypoints of a photo that some verified pair
    matches, by image id. ``positions``: what the session took for where photos are, by image id.
    """

    photos: Sequence[StoredPhoto] = ()
    unused: Sequence[Skipped] = ()
    skipped: Mapping[str, Path] = field(default_factory=dict)
    cameras: Mapping[int, pycolmap.Camera] = field(default_factory=dict)
    pairs: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), np.int64))
    num_matched: Mapping[int, int] = field(default_factory=dict)
    positions: Mapping[int, GeoPosition] = field(default_factory=dict)


def read_stored_session(database: Path) -> StoredSession:
    """An empty one if there is no such file, or it cannot be read, or is no session's."""
    return read_only(database, _read) or StoredSession()


def _read(connection: sqlite3.Connection) -> StoredSession:
    photos = stored_photos(connection)
    skipped = [*map(read_skipped, connection.execute(f"SELECT {SKIPPED_COLUMNS}"))]
    cameras = connection.execute(f"SELECT {CAMERA_COLUMNS}")
    pairs, num_matched = _pairs(connection, {p.image_id: p.num_keypoints for p in photos})
    return StoredSession(
        photos=photos,
        unused=[file for file, _ in skipped],
        skipped={file.name: state.path for file, state in skipped},
        cameras={row[0]: read_camera(row) for row in cameras},
        pairs=pairs,
        num_matched=num_matched,
        positions=_positions(connection, photos),
    )


def _pairs(
    connection: sqlite3.Connection, num_keypoints: Mapping[int, int]
) -> tuple[NDArray[np.int64], dict[int, int]]:
    """See ``StoredSession``; row by row, for all matches may not fit into memory."""
    matched = {image_id: np.zeros(count, np.bool_) for image_id, count in num_keypoints.items()}
    pairs = []
    rows = connection.execute("SELECT pair_id, rows, data FROM two_view_geometries WHERE rows > 0")
    for pair_id, count, data in rows:
        first, second = pycolmap.pair_id_to_image_pair(pair_id)
        pairs.append((first, second, count))
        inliers = np.frombuffer(data, np.uint32).reshape(count, 2)
        for image_id, keypoints in zip((first, second), inliers.T, strict=True):
            matched[image_id][keypoints] = True
    return (
        np.array(pairs, np.int64).reshape(-1, 3),
        {image_id: int(of_photo.sum()) for image_id, of_photo in matched.items()},
    )


def _positions(
    connection: sqlite3.Connection, photos: Sequence[StoredPhoto]
) -> dict[int, GeoPosition]:
    """COLMAP's priors, which have an altitude; without one, EXIF's."""
    positions = {
        photo.image_id: photo.exif.position
        for photo in photos
        if photo.exif.position is not None and photo.exif.position.altitude_m is None
    }
    rows = connection.execute("SELECT corr_data_id, position FROM pose_priors")
    return positions | {image_id: _position(blob) for image_id, blob in rows}


def _position(blob: Any) -> GeoPosition:
    latitude, longitude, altitude = np.frombuffer(blob, np.float64).tolist()
    return GeoPosition(latitude, longitude, altitude)
