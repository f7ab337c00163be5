"""The COLMAP database of a session, which also holds what a session needs to go on."""

from __future__ import annotations

import json
import logging
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import RLock
from typing import Any

import numpy as np
import pycolmap

from sfm_front.errors import StorageError
from sfm_front.runtime.closeable import Closeable
from sfm_front.storage.atomic import write_atomically
from sfm_front.storage.colmap_rows import (
    PAIR_COLUMNS,
    Row,
    camera_rows,
    pair_rows,
    photo_rows,
    read_camera,
    read_pair,
)
from sfm_front.storage.photo_json import candidate_of_row, candidate_row, exif_of_row, exif_row
from sfm_front.types import (
    CandidateOutcome,
    ExtractedPhoto,
    Features,
    FileState,
    Float32Array,
    PairGeometry,
    Skipped,
    SkipReason,
    StoredPhoto,
    Uint8Array,
)

logger = logging.getLogger(__name__)

# Tables beside COLMAP's, which its tools pass over.
_TABLES = """
CREATE TABLE IF NOT EXISTS sfm_front_session (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS sfm_front_photos (
    image_id INTEGER PRIMARY KEY NOT NULL, path BLOB NOT NULL, size INTEGER, mtime_ns INTEGER,
    width INTEGER NOT NULL, height INTEGER NOT NULL, digest TEXT NOT NULL, exif TEXT NOT NULL,
    global_vector BLOB NOT NULL, colors BLOB NOT NULL, candidates TEXT NOT NULL,
    seconds TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS sfm_front_skipped (
    name TEXT PRIMARY KEY NOT NULL, path BLOB NOT NULL, size INTEGER, mtime_ns INTEGER,
    reason TEXT NOT NULL, detail TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS sfm_front_pairs (
    number INTEGER PRIMARY KEY, later INTEGER NOT NULL, earlier INTEGER NOT NULL, tri_angle REAL);
CREATE INDEX IF NOT EXISTS sfm_front_pairs_by_photo ON sfm_front_pairs (later);
"""

_LOCK_PATIENCE_S = 600.0
_LOCK_POLL_S = 1.0


class PhotoDatabase(Closeable):
    """Writes photos to a COLMAP database that COLMAP's own tools can go on with.

    Each photo is one transaction: all of it is there, or nothing. When a write returns, it is on
    the disk and survives a power cut. Raises StorageError if the file cannot be used: disk full,
    damaged, locked by another program for ten minutes. Safe to read from several threads.

    Other processes may read the file meanwhile. In this process pycolmap must not open it before
    this is closed: pycolmap brings an SQLite of its own, and two of them in one process do not see
    each other's locks (sqlite.org/howtocorrupt.html).
    """

    def __init__(self, path: Path) -> None:
        """Open the database at ``path``, or create it."""
        self._path = path
        self._lock = RLock()
        if not path.exists():
            _create(path)
        with self._errors():
            self._connection = sqlite3.connect(
                path, timeout=_LOCK_POLL_S, isolation_level=None, check_same_thread=False
            )
            # A reader, or COLMAP's own tools, may look while a session writes.
            self._execute("PRAGMA journal_mode=WAL")
            # Each commit is on the disk before it returns.
            self._execute("PRAGMA synchronous=FULL")
            for statement in filter(str.strip, _TABLES.split(";")):
                self._execute(statement)

    # --- writing ---------------------------------------------------------------------------------

    def write(
        self,
        image_id: int,
        photo: ExtractedPhoto,
        camera: pycolmap.Camera,
        pairs: Sequence[PairGeometry],
        candidates: Sequence[CandidateOutcome] = (),
    ) -> None:
        """Write a photo, its camera and its pairs; if this raises, no row of the photo remains.

        It is not skipped any more, if it was. Ids are those given. A frame has its image's id, a
        rig its camera's.
        """
        with self._transaction():
            self._execute("DELETE FROM sfm_front_skipped WHERE name = ?", (photo.name,))
            for row in camera_rows(camera):
                self._insert(row)
            for row in photo_rows(image_id, photo, camera.camera_id):
                self._insert(row)
            for pair in pairs:
                for row in pair_rows(pair):
                    self._insert(row)
                # COLMAP's table has no place for the angle.
                known = {
                    "later": pair.image_id1,
                    "earlier": pair.image_id2,
                    "tri_angle": pair.two_view_geometry.tri_angle,
                }
                self._insert(Row("sfm_front_pairs", known))
            self._insert(
                Row(
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
                        "candidates": json.dumps(
                            [candidate_row(candidate) for candidate in candidates]
                        ),
                        "seconds": json.dumps(photo.seconds),
                    },
                )
            )

    def write_skipped(self, skipped: Skipped, path: Path) -> None:
        """Remember a file that is not used; a file of that name is written over."""
        with self._transaction():
            self._execute(
                "INSERT OR REPLACE INTO sfm_front_skipped VALUES (?, ?, ?, ?, ?, ?)",
                (skipped.name, *_file(path).values(), skipped.reason.value, skipped.detail),
            )

    def remember(self, key: str, value: str) -> None:
        """Keep a text about the session."""
        with self._transaction():
            self._execute("INSERT OR REPLACE INTO sfm_front_session VALUES (?, ?)", (key, value))

    # --- reading ---------------------------------------------------------------------------------

    def recall(self, key: str) -> str | None:
        """A text that was kept; None if there is none."""
        rows = self._rows("SELECT value FROM sfm_front_session WHERE key = ?", (key,))
        return str(rows[0][0]) if rows else None

    def holds_images(self) -> bool:
        """Whether COLMAP's table of images has any, whoever wrote them."""
        return bool(self._rows("SELECT 1 FROM images LIMIT 1"))

    def num_photos(self) -> int:
        """Photos that were written."""
        return int(self._rows("SELECT count(*) FROM sfm_front_photos")[0][0])

    def photos(self) -> Iterator[StoredPhoto]:
        """All photos, in order of arrival."""
        for row in self._each(
            "SELECT image_id, name, camera_id, path, size, mtime_ns, width, height, digest, exif, "
            "global_vector, candidates, seconds, keypoints.rows FROM sfm_front_photos "
            "JOIN images USING (image_id) JOIN keypoints USING (image_id) ORDER BY image_id"
        ):
            yield StoredPhoto(
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

    def skipped(self) -> list[tuple[Skipped, FileState]]:
        """Files that were not used, as they were then."""
        rows = self._rows(
            "SELECT name, path, size, mtime_ns, reason, detail FROM sfm_front_skipped"
        )
        return [
            (
                Skipped(name, SkipReason(reason), detail),
                FileState(Path(os.fsdecode(path)), size, mtime_ns),
            )
            for name, path, size, mtime_ns, reason, detail in rows
        ]

    def features(self, image_id: int) -> Features:
        """Features of a photo. Raises KeyError if there is no such photo."""
        keypoints, colors = self.keypoints(image_id)
        rows = self._rows("SELECT data FROM descriptors WHERE image_id = ?", (image_id,))
        descriptors = np.frombuffer(rows[0][0], np.uint8).reshape(len(keypoints), -1)
        return Features(keypoints, descriptors, colors)

    def keypoints(self, image_id: int) -> tuple[Float32Array, Uint8Array]:
        """(N, 4) keypoints and (N, 3) colours of a photo, without its descriptors.

        Raises KeyError if there is no such photo.
        """
        rows = self._rows(
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
        rows = self._rows(
            "SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras"
        )
        return {row[0]: read_camera(row) for row in rows}

    def pairs(self, image_id: int) -> list[PairGeometry]:
        """Verified pairs of a photo with earlier ones, as they were given to ``write``."""
        return [
            read_pair(image_id, earlier, self._pair_row(image_id, earlier), tri_angle)
            for earlier, tri_angle in self._rows(
                "SELECT earlier, tri_angle FROM sfm_front_pairs WHERE later = ? ORDER BY number",
                (image_id,),
            )
        ]

    def _pair_row(self, image_id1: int, image_id2: int) -> tuple[Any, ...]:
        pair_id = pycolmap.image_pair_to_pair_id(image_id1, image_id2)
        (row,) = self._rows(f"SELECT {PAIR_COLUMNS} WHERE pair_id = ?", (pair_id,))
        return row

    def close(self) -> None:
        with self._lock, self._errors():
            self._connection.close()

    # --- SQL -------------------------------------------------------------------------------------

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._lock, self._errors():
            self._begin()
            try:
                yield
                self._execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    def _begin(self) -> None:
        """Wait while another program writes, and say so."""
        if not self._path.exists():
            # SQLite would go on to write to a file that no longer has a name.
            raise StorageError(
                f"{self._path}: was removed while it was written to. Begin anew with the same "
                "command."
            )
        until = time.monotonic() + _LOCK_PATIENCE_S
        waiting = False
        while True:
            try:
                self._execute("BEGIN IMMEDIATE")
                return
            except sqlite3.OperationalError as error:
                if "locked" not in str(error) or time.monotonic() > until:
                    raise
                if not waiting:
                    logger.warning("%s: locked by another program, waiting for it", self._path)
                waiting = True

    def _insert(self, row: Row) -> None:
        names = ", ".join(row.values)
        marks = ", ".join("?" * len(row.values))
        either = "OR IGNORE " if row.once else ""
        self._execute(
            f"INSERT {either}INTO {row.table} ({names}) VALUES ({marks})",
            tuple(row.values.values()),
        )

    def _each(self, statement: str) -> Iterator[tuple[Any, ...]]:
        """Row by row: all of them may not fit into memory."""
        with self._errors():
            yield from self._connection.execute(statement)

    def _rows(self, statement: str, values: Iterable[Any] = ()) -> list[tuple[Any, ...]]:
        with self._lock, self._errors():
            return self._connection.execute(statement, tuple(values)).fetchall()

    def _execute(self, statement: str, values: Iterable[Any] = ()) -> None:
        self._connection.execute(statement, tuple(values))

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise StorageError(f"{self._path}: {error}. {_what_now(error)}") from error


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


def _what_now(error: sqlite3.Error) -> str:
    text = str(error)
    if "full" in text:
        return "Make room, and give the same command again: it goes on from here."
    if "not a database" in text or "malformed" in text:
        return "It is damaged: give --overwrite to begin anew, or another --output."
    return "The same command goes on from here once that is mended."


def _file(path: Path) -> dict[str, Any]:
    """Where a file is, and its state now; None if it is gone."""
    state = FileState.of(path)
    return {"path": os.fsencode(state.path), "size": state.size, "mtime_ns": state.mtime_ns}
