"""A folder -> the photos in it, in order of arrival."""

from __future__ import annotations

import logging
import os
import random
import re
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Literal, TypeVar, get_args

from sfm_front.errors import ConfigError, InputError
from sfm_front.photos.exif import read_exif
from sfm_front.photos.formats import EXTENSIONS
from sfm_front.types import PhotoPath

logger = logging.getLogger(__name__)

Item = TypeVar("Item")
PhotoOrder = Literal["name", "time", "random"]

_MOST_WARNINGS = 10
_ESCAPED = re.compile(r"\\x[0-9a-f]{2}")


def list_photos(folder: Path, *, exclude: Path | None = None) -> list[PhotoPath]:
    """Every photo below ``folder``, sub-folders and links to folders included, sorted by name as
    text (``img10`` before ``img2``), as COLMAP sorts them.

    Photos are recognised by extension alone, so that broken ones can be reported; other files, and
    hidden files and folders, are ignored. Sub-folders that cannot be read are passed over with a
    warning. Nothing below ``exclude`` is listed: the output folder may lie among the photos.
    Raises InputError if ``folder`` cannot be read or holds no photo.
    """
    try:
        top = _identity(folder)
    except FileNotFoundError as error:
        raise InputError(
            f"{folder}: no such folder. Give the folder that holds the photos."
        ) from error
    except NotADirectoryError as error:
        raise InputError(
            f"{folder}: not a folder. Give the folder that holds the photos."
        ) from error
    except (OSError, ValueError) as error:
        raise InputError(_unreadable(folder, error)) from error
    walk = _Walk({top} | _identities(exclude))
    photos = walk.named_photos(folder)
    if str(folder) in walk.passed_over:
        raise InputError(_unreadable(folder, walk.passed_over[str(folder)]))
    walk.warn()
    if not photos:
        unread = f" that can be read ({len(walk.passed_over)} cannot)" if walk.passed_over else ""
        raise InputError(
            f"{folder}: no photo in it or its sub-folders{unread}. "
            f"Photos end in {', '.join(EXTENSIONS)}, in upper or lower case."
        )
    return photos


def find_photos(
    folder: Path, *, exclude: Path | None, on_error: Callable[[OSError], None]
) -> list[PhotoPath]:
    """As ``list_photos``, but there need not be any photo, nor the folder.

    ``on_error`` hears of each folder that cannot be listed.
    """
    walk = _Walk(_identities(folder) | _identities(exclude))
    photos = walk.named_photos(folder)
    for path, error in walk.passed_over.items():
        error.filename = error.filename or path
        on_error(error)
    return photos


def files_by_name(folder: Path) -> dict[str, Path]:
    """Photos that have moved since, by the names that models have for them; by the rules that named
    them, so that no name leads out of the folder. Raises InputError if there is no such folder."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder. Give the folder of the photos.")
    found = find_photos(folder, exclude=None, on_error=lambda _error: None)
    return {photo.name: photo.path for photo in found}


def folder_identity(folder: Path) -> tuple[int, int] | None:
    """Device and inode: the same by whatever path it is reached; None if it cannot be entered."""
    return next(iter(_identities(folder)), None)


def shuffled(items: Iterable[Item], seed: int) -> list[Item]:
    """In an order that ``seed`` alone determines."""
    order = list(items)
    random.Random(seed).shuffle(order)
    return order


def order_photos(
    photos: Iterable[PhotoPath], order: PhotoOrder = "name", *, seed: int = 0
) -> list[PhotoPath]:
    """Photos by ``name``; by ``time`` of capture, then name, those without a time last; or in
    ``random`` order, determined by ``seed`` alone."""
    if order not in get_args(PhotoOrder):
        raise ConfigError(f"order must be one of {', '.join(get_args(PhotoOrder))}, got {order}")
    by_name = sorted(photos, key=lambda photo: photo.name)
    if order == "random":
        return shuffled(by_name, seed)
    if order == "time":
        by_name.sort(key=_capture_time)
    return by_name


def _capture_time(photo: PhotoPath) -> datetime:
    return read_exif(photo.path).captured_at or datetime.max


class _Walk:
    """A walk through folders, each visited once even if links form a loop.

    ``passed_over``: folders that could not be read, and why.
    """

    def __init__(self, seen: set[tuple[int, int]]) -> None:
        self.passed_over: dict[str, OSError] = {}
        self._seen = seen

    def named_photos(self, folder: Path) -> list[PhotoPath]:
        """The photos below ``folder``, sorted by name."""
        photos = [PhotoPath(_name_below(folder, path), path) for path in self.photos(folder)]
        return sorted(photos, key=lambda photo: photo.name)

    def photos(self, folder: Path) -> Iterator[Path]:
        """Paths of the photos below ``folder``."""
        # Not recursive, as os.walk is before Python 3.12: folders may be nested 1000 deep.
        pending = [str(folder)]
        while pending:
            here = pending.pop()
            try:
                with os.scandir(here) as entries:
                    listed = sorted(entries, key=lambda entry: entry.name)
            except OSError as error:
                self.passed_over[here] = error
                continue
            folders = []
            for entry in listed:
                if entry.name.startswith("."):
                    continue
                if _is_folder(entry):
                    if self._is_new(entry.path):
                        folders.append(entry.path)
                elif entry.name.lower().endswith(EXTENSIONS):
                    yield Path(entry.path)
            pending += reversed(folders)

    def warn(self) -> None:
        """Name what was passed over."""
        for path, error in islice(self.passed_over.items(), _MOST_WARNINGS):
            logger.warning("passed over %s: %s", path, error.strerror)
        if len(self.passed_over) > _MOST_WARNINGS:
            more = len(self.passed_over) - _MOST_WARNINGS
            logger.warning("passed over %d more folders that cannot be read", more)

    def _is_new(self, folder: str) -> bool:
        try:
            identity = _identity(folder)
        except OSError as error:
            self.passed_over[folder] = error
            return False
        if identity in self._seen:
            return False
        self._seen.add(identity)
        return True


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # A link that leads nowhere it may: the reader gives the reason.
        return False


def _identity(folder: Path | str) -> tuple[int, int]:
    """Device and inode. Raises OSError unless the files in ``folder`` can be reached."""
    # The dot asks for search permission, without which a folder's names can be listed for nothing.
    status = os.stat(os.path.join(folder, os.curdir))  # noqa: PTH116, PTH118
    return status.st_dev, status.st_ino


def _identities(folder: Path | None) -> set[tuple[int, int]]:
    try:
        return set() if folder is None else {_identity(folder)}
    except (OSError, ValueError):  # There is nothing below it that could be listed.
        return set()


def _unreadable(folder: Path, error: OSError | ValueError) -> str:
    reason = getattr(error, "strerror", None) or str(error)
    return f"{folder}: cannot be read ({reason}). Give a folder that you may read and enter."


def _name_below(folder: Path, path: Path) -> str:
    r"""The name in valid UTF-8, as databases and JSON need it: stray bytes become ``\xe4``.

    Two files never get the same name: where a name looks like an escaped one, its backslashes are
    escaped too.
    """
    raw = os.fsencode(path.relative_to(folder).as_posix())
    escaped = raw.decode("utf-8", errors="backslashreplace")
    if _ESCAPED.search(escaped) is None:
        return escaped
    return raw.replace(b"\\", b"\\x5c").decode("utf-8", errors="backslashreplace")
