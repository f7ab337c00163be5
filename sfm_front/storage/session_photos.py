"""The photos that a session has stored, read without writing to its database."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TypeVar

from sfm_front.storage.session_rows import PHOTO_COLUMNS, read_photo
from sfm_front.types import StoredPhoto

Result = TypeVar("Result")

# The first removes its lock files when it closes; the second needs none, and does for a folder that
# nobody can write to.
_ACCESS = ("mode=rw", "mode=ro&immutable=1")


def read_photos(database: Path) -> list[StoredPhoto] | None:
    """All photos in the database of a session, in order of arrival; None as ``read_only``."""
    return read_only(database, stored_photos)


def stored_photos(connection: sqlite3.Connection) -> list[StoredPhoto]:
    """Of a session's database, in order of arrival."""
    rows = connection.execute(f"SELECT {PHOTO_COLUMNS} ORDER BY image_id")
    return [read_photo(row) for row in rows]


def read_only(database: Path, read: Callable[[sqlite3.Connection], Result]) -> Result | None:
    """What ``read`` finds in the database of a session.

    None if there is no such file, or it cannot be read, or is no session's: COLMAP's own databases
    have the same name, and opening one as ``PhotoDatabase`` would add our tables to it.
    """
    for access in _ACCESS:
        try:
            address = f"{database.absolute().as_uri()}?{access}"
            with closing(sqlite3.connect(address, uri=True)) as connection:
                return read(connection)
        except sqlite3.Error:
            continue
    return None
