"""The COLMAP database of a session, which also holds what a session needs to go on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pycolmap

from sfm_front.errors import StorageError
from sfm_front.runtime.closeable import Closeable
from sfm_front.storage.atomic import write_atomically
from sfm_front.storage.colmap_rows import (
    CAMERA_COLUMNS,
    PAIR_COLUMNS,
    camera_rows,
    inlier_data,
    pair_rows,
    photo_rows,
    prior_rows,
    read_camera,
    read_pair,
)
from sfm_front.storage.session_rows import (
    PHOTO_COLUMNS,
    SKIPPED_COLUMNS,
    TABLES,
    pair_row,
    photo_row,
    read_photo,
    read_skipped,
    skipped_row,
)
from sfm_front.storage.sqlite_file import SqliteFile
from sfm_front.types import (
    CandidateOutcome,
    ExtractedPhoto,
    Features,
    FileState,
    Float32Array,
    GeoPosition,
    PairGeometry,
    Skipped,
    StoredPhoto,
    Uint8Array,
    Uint32Array,
)

DATABASE = "database.db"
"""Its name in an output."""


class PhotoDatabase(Closeable):
    """Writes photos to a COLMAP database that COLMAP's own tools can go on with.

    Each photo is one transaction: all of it is there, or nothing. When a write returns, it is on
    the disk and survives a power cut. Raises StorageError as ``SqliteFile`` does.

    Other processes may read the file meanwhile. In this process pycolmap must not open it before
    this is closed: pycolmap brings an SQLite of its own, and two of them in one process do not see
    each other's locks (sqlite.org/howtocorrupt.html).
    """

    def __init__(self, path: Path) -> None:
        """Open the database at ``path``, or create it."""
        if not path.exists():
            _create(path)
        self._file = SqliteFile(path)
        for statement in TABLES:
            self._file.execute(statement)

    def write(
        self,
        image_id: int,
        photo: ExtractedPhoto,
        camera: pycolmap.Camera,
        pairs: Sequence[PairGeometry],
        candidates: Sequence[CandidateOutcome] = (),
        prior: GeoPosition | None = None,
    ) -> None:
        """Write a photo, its camera and its pairs; if this raises, no row of the photo remains.

        ``prior``: where it was taken; COLMAP is told if the altitude is known. The photo is not
        skipped any more, if it was. Ids are those given. A frame has its image's id, a rig its
        camera's.
        """
        with self._file.transaction():
            self._forget_skipped(photo.name)
            for row in camera_rows(camera):
                self._file.insert(row)
            for row in photo_rows(image_id, photo, camera.camera_id):
                self._file.insert(row)
            if prior is not None:
                for row in prior_rows(image_id, camera.camera_id, prior):
                    self._file.insert(row)
            self._insert_pairs(pairs)
            self._file.insert(photo_row(image_id, photo, candidates))

    def write_priors(self, priors: Mapping[int, GeoPosition]) -> None:
        """Replace the priors of all photos by these, by image id, if their altitude is known."""
        with self._file.transaction():
            self._file.execute("DELETE FROM pose_priors")
            for image_id, camera_id in self._file.rows("SELECT image_id, camera_id FROM images"):
                if image_id in priors:
                    for row in prior_rows(image_id, camera_id, priors[image_id]):
                        self._file.insert(row)

    def write_pairs(self, pairs: Sequence[PairGeometry]) -> None:
        """Write pairs of photos that are there, found later: all of them, or none."""
        with self._file.transaction():
            self._insert_pairs(pairs)

    def keep_matches(self, kept: Mapping[tuple[int, int], Uint32Array]) -> None:
        """Leave verified pairs, named by later and earlier photo, only these (M, 2) of their
        inliers. A pair without any is verified no longer; its tentative matches stay."""
        with self._file.transaction():
            for (later, earlier), matches in kept.items():
                pair_id = pycolmap.image_pair_to_pair_id(later, earlier)
                if len(matches):
                    self._file.execute(
                        "UPDATE two_view_geometries SET rows = ?, data = ? WHERE pair_id = ?",
                        (len(matches), inlier_data(later, earlier, matches), pair_id),
                    )
                    continue
                self._file.execute("DELETE FROM two_view_geometries WHERE pair_id = ?", (pair_id,))
                self._file.execute(
                    "DELETE FROM sfm_front_pairs WHERE later = ? AND earlier = ?", (later, earlier)
                )

    def _insert_pairs(self, pairs: Sequence[PairGeometry]) -> None:
        for pair in pairs:
            for row in pair_rows(pair):
                self._file.insert(row)
            self._file.insert(pair_row(pair))

    def write_skipped(self, skipped: Skipped, path: Path) -> None:
        """Remember a file that is not used; a file of that name is written over."""
        with self._file.transaction():
            self._forget_skipped(skipped.name)
            self._file.insert(skipped_row(skipped, path))

    def _forget_skipped(self, name: str) -> None:
        self._file.execute("DELETE FROM sfm_front_skipped WHERE name = ?", (name,))

    def remember(self, key: str, value: str) -> None:
        """Keep a text about the session."""
        with self._file.transaction():
            self._file.execute(
                "INSERT OR REPLACE INTO sfm_front_session VALUES (?, ?)", (key, value)
            )

    def recall(self, key: str) -> str | None:
        """A text that was kept; None if there is none."""
        rows = self._file.rows("SELECT value FROM sfm_front_session WHERE key = ?", (key,))
        return str(rows[0][0]) if rows else None

    def holds_images(self) -> bool:
        """Whether COLMAP's table of images has any, whoever wrote them."""
        return bool(self._file.rows("SELECT 1 FROM images LIMIT 1"))

    def num_photos(self) -> int:
        """Photos that were written."""
        return int(self._file.rows("SELECT count(*) FROM sfm_front_photos")[0][0])

    def photos(self) -> Iterator[StoredPhoto]:
        """All photos, in order of arrival."""
        yield from map(read_photo, self._file.each(f"SELECT {PHOTO_COLUMNS} ORDER BY image_id"))

    def skipped(self) -> list[tuple[Skipped, FileState]]:
        """Files that were not used, as they were then."""
        return [read_skipped(row) for row in self._file.rows(f"SELECT {SKIPPED_COLUMNS}")]

    def features(self, image_id: int) -> Features:
        """Features of a photo. Raises KeyError if there is no such photo."""
        keypoints, colors = self.keypoints(image_id)
        rows = self._file.rows("SELECT data FROM descriptors WHERE image_id = ?", (image_id,))
        descriptors = np.frombuffer(rows[0][0], np.uint8).reshape(len(keypoints), -1)
        return Features(keypoints, descriptors, colors)

    def keypoints(self, image_id: int) -> tuple[Float32Array, Uint8Array]:
        """(N, 4) keypoints and (N, 3) colours of a photo, without its descriptors.

        Raises KeyError if there is no such photo.
        """
        rows = self._file.rows(
            "SELECT k.rows, k.cols, k.data, p.colors FROM keypoints k "
            "JOIN sfm_front_photos p USING (image_id) WHERE image_id = ?",
            (image_id,),
        )
        if not rows:
            raise KeyError(image_id)
        num, cols, keypoints, colors = rows[0]
        return (
            np.frombuffer(keypoints, np.float32).reshape(num, cols),
            np.frombuffer(colors, np.uint8).reshape(num, 3),
        )

    def cameras(self) -> dict[int, pycolmap.Camera]:
        """Camera id → camera, as photos started with it."""
        rows = self._file.rows(f"SELECT {CAMERA_COLUMNS}")
        return {row[0]: read_camera(row) for row in rows}

    def pairs(self, image_id: int) -> list[PairGeometry]:
        """Verified pairs of a photo with earlier ones, as they were given to ``write``."""
        return [
            read_pair(image_id, earlier, self._pair(image_id, earlier), tri_angle)
            for earlier, tri_angle in self._file.rows(
                "SELECT earlier, tri_angle FROM sfm_front_pairs WHERE later = ? ORDER BY number",
                (image_id,),
            )
        ]

    def _pair(self, image_id1: int, image_id2: int) -> tuple[Any, ...]:
        pair_id = pycolmap.image_pair_to_pair_id(image_id1, image_id2)
        (row,) = self._file.rows(f"SELECT {PAIR_COLUMNS} WHERE pair_id = ?", (pair_id,))
        return row

    def close(self) -> None:
        self._file.close()


def _create(path: Path) -> None:
    """An empty database, whole or not at all: COLMAP commits its tables one by one."""
    with TemporaryDirectory(prefix="sfm_front_") as folder:
        empty = Path(folder) / path.name
        try:
            # COLMAP's tables are COLMAP's to define.
            pycolmap.Database.open(empty).close()
            content = empty.read_bytes()
        except (RuntimeError, OSError) as error:
            raise StorageError(f"{folder}: COLMAP cannot write there. Make room.") from error
    write_atomically(path, lambda file: file.write(content))
