"""One photo of a session's database, its file and its verified pairs, read while others write."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.storage.session_photos import read_only
from sfm_front.types import Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class VerifiedMatches:
    """``xy1``, ``xy2`` (M, 2): inliers in pixels of the files, and these files' (width, height)."""

    xy1: Float64Array
    xy2: Float64Array
    sizes: tuple[tuple[int, int], tuple[int, int]]


def photo_file(database: Path, name: str) -> Path | None:
    """Where a photo was, used or not; None if the database does not know it."""

    def read(connection: sqlite3.Connection) -> Path | None:
        for query in (
            "SELECT path FROM sfm_front_photos JOIN images USING (image_id) WHERE name = ?",
            "SELECT path FROM sfm_front_skipped WHERE name = ?",
        ):
            for (path,) in connection.execute(query, (name,)):
                return Path(os.fsdecode(path))
        return None

    return read_only(database, read)


def num_inliers(database: Path, image_id: int, others: Collection[int]) -> Mapping[int, int]:
    """Inliers of the verified pairs of a photo with ``others``, by their image ids."""
    pair_ids = {
        pycolmap.image_pair_to_pair_id(image_id, other): other
        for other in others
        if other != image_id
    }

    def read(connection: sqlite3.Connection) -> dict[int, int]:
        query = "SELECT rows FROM two_view_geometries WHERE pair_id = ? AND rows > 0"
        return {
            other: rows
            for pair_id, other in pair_ids.items()
            for (rows,) in connection.execute(query, (pair_id,))
        }

    return read_only(database, read) or {}


def verified_matches(database: Path, image_id1: int, image_id2: int) -> VerifiedMatches | None:
    """Those of a pair; None if it is not verified."""

    def read(connection: sqlite3.Connection) -> VerifiedMatches | None:
        pair_id = pycolmap.image_pair_to_pair_id(image_id1, image_id2)
        query = "SELECT rows, data FROM two_view_geometries WHERE pair_id = ? AND rows > 0"
        for rows, data in connection.execute(query, (pair_id,)):
            inliers = np.frombuffer(data, np.uint32).reshape(rows, 2)
            if image_id1 > image_id2:
                inliers = inliers[:, ::-1]
            (xy1, size1), (xy2, size2) = (
                _keypoints(connection, image_id) for image_id in (image_id1, image_id2)
            )
            return VerifiedMatches(xy1[inliers[:, 0]], xy2[inliers[:, 1]], (size1, size2))
        return None

    return read_only(database, read)


def _keypoints(
    connection: sqlite3.Connection, image_id: int
) -> tuple[Float64Array, tuple[int, int]]:
    """(N, 2) pixels of the file, and its size."""
    row = connection.execute(
        "SELECT rows, cols, data, width, height FROM keypoints "
        "JOIN sfm_front_photos USING (image_id) WHERE image_id = ?",
        (image_id,),
    ).fetchone()
    rows, columns, data, width, height = row
    keypoints: NDArray[np.float32] = np.frombuffer(data, np.float32).reshape(rows, columns)
    return keypoints[:, :2].astype(np.float64), (width, height)
