"""An SQLite file: transactions are on the disk when they end, errors say what to do."""

from __future__ import annotations

import logging
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from typing import Any, NamedTuple

from sfm_front.errors import StorageError
from sfm_front.runtime.closeable import Closeable

logger = logging.getLogger(__name__)

_LOCK_PATIENCE_S = 600.0
_LOCK_POLL_S = 1.0


class Row(NamedTuple):
    """A row of ``table``; ``once``: it may be there already."""

    table: str
    values: dict[str, Any]
    once: bool = False


class SqliteFile(Closeable):
    """Raises StorageError if the file cannot be used: disk full, damaged, locked by another program
    for ten minutes. Safe to read from several threads."""

    def __init__(self, path: Path) -> None:
        """Open the file at ``path``."""
        self._path = path
        self._lock = RLock()
        with self._errors():
            self._connection = sqlite3.connect(
                path, timeout=_LOCK_POLL_S, isolation_level=None, check_same_thread=False
            )
            # A reader, or COLMAP's own tools, may look while a session writes.
            self._connection.execute("PRAGMA journal_mode=WAL")
            # Each commit is on the disk before it returns.
            self._connection.execute("PRAGMA synchronous=FULL")

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """What is written inside is on the disk when this ends; if it raises, nothing is."""
        with self._lock, self._errors():
            self._begin()
            try:
                yield
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    def execute(self, statement: str, values: Iterable[Any] = ()) -> None:
        """Run a statement that has no result."""
        with self._lock, self._errors():
            self._connection.execute(statement, tuple(values))

    def insert(self, row: Row) -> None:
        """Insert a row."""
        names = ", ".join(row.values)
        marks = ", ".join("?" * len(row.values))
        either = "OR IGNORE " if row.once else ""
        self.execute(
            f"INSERT {either}INTO {row.table} ({names}) VALUES ({marks})", row.values.values()
        )

    def rows(self, statement: str, values: Iterable[Any] = ()) -> list[tuple[Any, ...]]:
        """All rows of a result."""
        with self._lock, self._errors():
            return self._connection.execute(statement, tuple(values)).fetchall()

    def each(self, statement: str) -> Iterator[tuple[Any, ...]]:
        """Row by row: all of them may not fit into memory."""
        with self._errors():
            yield from self._connection.execute(statement)

    def close(self) -> None:
        with self._lock, self._errors():
            self._connection.close()

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
                self._connection.execute("BEGIN IMMEDIATE")
                return
            except sqlite3.OperationalError as error:
                if "locked" not in str(error) or time.monotonic() > until:
                    raise
                if not waiting:
                    logger.warning("%s: locked by another program, waiting for it", self._path)
                waiting = True

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise StorageError(f"{self._path}: {error}. {_what_now(error)}") from error


def _what_now(error: sqlite3.Error) -> str:
    text = str(error)
    if "full" in text:
        return "Make room, and give the same command again: it goes on from here."
    if "not a database" in text or "malformed" in text:
        return "It is damaged: give --overwrite to begin anew, or another --output."
    return "The same command goes on from here once that is mended."
