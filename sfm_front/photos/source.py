"""A folder → its photos, in order of arrival."""

from __future__ import annotations

import logging
import os
import random
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Literal, get_args

from sfm_front.errors import ConfigError, InputError
from sfm_front.photos.exif import read_exif
from sfm_front.photos.formats import EXTENSIONS
from sfm_front.types import PhotoPath

logger = logging.getLogger(__name__)

PhotoOrder = Literal["name", "time", "random"]


def list_photos(folder: Path, *, exclude: Path | None = None) -> list[PhotoPath]:
    """Every photo below ``folder``, sub-folders and links to folders included, sorted by name as
    text (``img10`` before ``img2``), as COLMAP sorts them.

    Photos are recognised by extension alone, so that broken ones can be reported; other files, and
    hidden files and folders, are ignored. Nothing below ``exclude`` is listed: the output folder
    may lie among the photos. Raises InputError if the folder is missing or holds no photo.
    """
    if not folder.exists():
        raise InputError(f"{folder}: no such folder. Give the folder that holds the photos.")
    if not folder.is_dir():
        raise InputError(f"{folder}: not a folder. Give the folder that holds the photos.")
    photos = find_photos(folder, exclude=exclude, on_error=_warn)
    if not photos:
        raise InputError(
            f"{folder}: no photo in it or its sub-folders. "
            f"Photos end in {', '.join(EXTENSIONS)}, in upper or lower case."
        )
    return photos


def find_photos(
    folder: Path, *, exclude: Path | None, on_error: Callable[[OSError], None]
) -> list[PhotoPath]:
    """As ``list_photos``, but there need not be any photo, nor the folder.

    ``on_error`` hears of each folder that cannot be listed.
    """
    paths = _walk(folder, exclude, on_error)
    photos = [PhotoPath(_name_below(folder, path), path) for path in paths]
    return sorted(photos, key=lambda photo: photo.name)


def order_photos(
    photos: Iterable[PhotoPath], order: PhotoOrder = "name", *, seed: int = 0
) -> list[PhotoPath]:
    """Photos by ``name``; by ``time`` of capture, then name, those without a time last; or in
    ``random`` order, which depends on ``seed`` alone."""
    if order not in get_args(PhotoOrder):
        raise ConfigError(f"order must be one of {', '.join(get_args(PhotoOrder))}, got {order}")
    by_name = sorted(photos, key=lambda photo: photo.name)
    if order == "random":
        random.Random(seed).shuffle(by_name)
    elif order == "time":
        by_name.sort(key=_capture_time)
    return by_name


def _capture_time(photo: PhotoPath) -> datetime:
    return read_exif(photo.path).captured_at or datetime.max


def _warn(error: OSError) -> None:
    logger.warning("%s: cannot be listed: %s", error.filename, error.strerror)


def _walk(
    folder: Path, exclude: Path | None, on_error: Callable[[OSError], None]
) -> Iterator[Path]:
    """Paths of the photos below ``folder``; each folder once, even if links form a loop."""
    # None stands for a folder that has vanished since it was listed.
    seen = {None, folder_identity(folder)}
    if exclude is not None:
        seen.add(folder_identity(exclude))
    for root, folders, files in os.walk(folder, onerror=on_error, followlinks=True):
        here = Path(root)
        kept = []
        for name in sorted(folders):
            identity = folder_identity(here / name)
            if not name.startswith(".") and identity not in seen:
                seen.add(identity)
                kept.append(name)
        folders[:] = kept
        for name in files:
            if not name.startswith(".") and name.lower().endswith(EXTENSIONS):
                yield here / name


def folder_identity(folder: Path) -> tuple[int, int] | None:
    """Device and inode: the same by whatever path it is reached; None if it is not there."""
    try:
        status = folder.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _name_below(folder: Path, path: Path) -> str:
    """The name in valid UTF-8, as databases and JSON need it: stray bytes become ``\\xe4``."""
    raw = os.fsencode(path.relative_to(folder).as_posix())
    return raw.decode("utf-8", errors="backslashreplace")
