"""Write a folder whole or not at all, and never over another."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sfm_front.errors import InputError, StorageError
from sfm_front.storage.atomic import sync


def check_vacant(folder: Path) -> None:
    """Raise InputError if there is something at ``folder``; an empty folder is nothing."""
    try:
        vacant = not (folder.exists() or folder.is_symlink()) or (
            folder.is_dir() and not any(folder.iterdir())
        )
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be looked into ({error.strerror}). Give another --output."
        ) from error
    if not vacant:
        raise InputError(
            f"{folder}: is there already, and nothing is written over. "
            "Move it away, or give another --output."
        )


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A folder beside ``folder`` to write to, moved into place at the end.

    If the block raises, nothing of it remains. Raises InputError as ``check_vacant`` does or if
    no folder can be made there, and StorageError for an OSError of the block: the disk is full.
    """
    check_vacant(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}). Give another --output."
        ) from error
    try:
        yield fresh
        # mkdtemp makes folders that only their owner can enter.
        fresh.chmod(0o755)
        _sync_all(fresh)
        if folder.is_dir():
            folder.rmdir()
        fresh.rename(folder)
        sync(folder.parent)
    except OSError as error:
        raise StorageError(
            f"{folder}: cannot be written ({error.strerror or error}). Make room, or give another "
            "--output."
        ) from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _sync_all(folder: Path) -> None:
    for path in folder.rglob("*"):
        if not path.is_symlink():
            sync(path)
    sync(folder)
