"""The photos that a session has stored, read without writing to its database."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from sfm_front.storage.session_rows import PHOTO_COLUMNS, read_photo
from sfm_front.types import StoredPhoto

# The first removes its lock files when it closes; the second needs none, and does for a folder that
# nobody can write to.
_ACCESS = ("mode=rw", "mode=ro&immutable=1")


def read_photos(database: Path) -> list[StoredPhoto] | None:
    """All photos in the database of a session, in order of arrival.

    None if there is no such file, or it cannot be read, or is no session's: COLMAP's own databases
    have the same name, and opening one as ``PhotoDatabase`` would add our tables to it.
    """
    for address in addresses(database):
        try:
            with closing(sqlite3.connect(address, uri=True)) as connection:
                rows = connection.execute(f"SELECT {PHOTO_COLUMNS} ORDER BY image_id")
                return [read_photo(row) for row in rows]
        except sqlite3.Error:
            continue
    return None


def addresses(database: Path) -> list[str]:
    """How to open the file for reading, for SQLite; the second where the first fails."""
    return [f"{database.absolute().as_uri()}?{access}" for access in _ACCESS]
