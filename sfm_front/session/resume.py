"""Whether an output can be gone on with, and what of a folder it has seen already."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, overload

from sfm_front.errors import InputError
from sfm_front.session.options import SessionOptions
from sfm_front.session.output_folder import check_output_folder, holds_session
from sfm_front.session.photo_folders import PhotoFolders
from sfm_front.storage.database import DATABASE, PhotoDatabase
from sfm_front.storage.json_files import as_json
from sfm_front.storage.session_lock import SessionLock
from sfm_front.types import FileState, NotYet, PhotoPath

_OPTIONS = "options"
_STATE = "state"
_RUNNING, _FINISHED = "running", "finished"

# Beside the options: what was in the files that they name.
_FILES = "files"
# What comes of these is computed anew whenever a session goes on: no photo is stored with more than
# its own EXIF.
_ANEW = ("positions", "control_points")
# The others say how the work is done, not what comes out of it.
_FREE = frozenset(
    {
        "threads",
        "num_threads",
        "device",
        "weights",
        "text",
        "snapshot_seconds",
        "cache_mb",
        *_ANEW,
    }
)


def check_options(database: PhotoDatabase, options: SessionOptions, output: Path) -> bool:
    """True if there is a session to go on with; the options of a new one are remembered.

    Raises InputError if the stored one was made with other options, or by an earlier version.
    """
    now = as_dict(options)
    text = database.recall(_OPTIONS)
    if text is None:
        if database.holds_images():
            raise InputError(
                f"{output}: holds a reconstruction of an earlier version, which cannot be "
                "continued. Give --overwrite, or another --output."
            )
        database.remember(_OPTIONS, json.dumps(now))
        return False
    for name, before, given in _differences(json.loads(text), now):
        raise InputError(
            f"{output}: was made with {name} = {before}, now it is {given}. Give the same options, "
            "--overwrite, or another --output."
        )
    return True


def mark_running(database: PhotoDatabase, options: SessionOptions) -> None:
    """From here on, until it is finished, the session has to be gone on with; with these options,
    which ``check_options`` has let pass."""
    content = {**as_dict(options), _FILES: _contents(options)}
    database.remember(_OPTIONS, json.dumps(content))
    database.remember(_STATE, _RUNNING)


def mark_finished(database: PhotoDatabase) -> None:
    """All models are written."""
    database.remember(_STATE, _FINISHED)


def is_finished(database: PhotoDatabase) -> bool:
    """Whether it ended with all its models written."""
    return database.recall(_STATE) == _FINISHED


class Newcomers:
    """Which photos of a folder a session has not seen, under their names in it."""

    def __init__(
        self, database: PhotoDatabase, folder: Path, output: Path, *, append: bool
    ) -> None:
        """``append``: whether photos of another folder may be added.

        Raises InputError if they may not, and the session is over another folder.
        """
        self._folders = PhotoFolders(database)
        self._folder = folder.resolve()
        known = self._folders.prefixes
        if known and not append and str(self._folder) not in known:
            raise InputError(
                f"{output}: holds the photos of {next(iter(known))}. Give --append to add "
                f"those of {folder} to it, or another --output."
            )
        self._used = {photo.name: photo.file for photo in database.photos()}
        self._skipped = {photo.name: file for photo, file in database.skipped()}

    @overload
    def among(
        self, photos: Sequence[PhotoPath], note: Callable[[str], None]
    ) -> Iterator[PhotoPath]: ...
    @overload
    def among(
        self, photos: Iterable[PhotoPath | NotYet], note: Callable[[str], None]
    ) -> Iterator[PhotoPath | NotYet]: ...
    def among(
        self, photos: Iterable[PhotoPath | NotYet], note: Callable[[str], None]
    ) -> Iterator[PhotoPath | NotYet]:
        """New photos, in their order. A file that was skipped and has changed since is new; one
        that was used and has changed stays as it was, and is told to ``note``.
        """
        prefix: str | None = None
        for photo in photos:
            if isinstance(photo, NotYet):
                yield photo
                continue
            if prefix is None:
                taken = self._used.keys() | self._skipped.keys()
                prefix = self._folders.prefix(self._folder, taken)
            named = PhotoPath(prefix + photo.name, photo.path)
            if self._is_new(named, note):
                yield named

    def _is_new(self, photo: PhotoPath, note: Callable[[str], None]) -> bool:
        now = FileState.of(photo.path)
        if photo.name in self._used:
            if not _same(self._used[photo.name], now):
                note(f"{photo.name}: has changed since it was taken in; the old one stays")
            return False
        return photo.name not in self._skipped or not _same(self._skipped[photo.name], now)


def nothing_to_do(
    output: Path,
    options: SessionOptions,
    folder: Path,
    photos: Sequence[PhotoPath],
    *,
    append: bool,
) -> bool:
    """Whether a finished session holds all these photos, with these positions and control points;
    asked before anything heavy is loaded.

    Raises InputError if the session cannot be continued so, or another process writes to it.
    """
    check_output_folder(output, overwrite=False, resume=True)
    if not holds_session(output):
        return False
    with SessionLock(output), PhotoDatabase(output / DATABASE) as database:
        if not check_options(database, options, output) or not is_finished(database):
            return False
        if not _as_before(database, options):
            return False
        newcomers = Newcomers(database, folder, output, append=append)
        return next(newcomers.among(photos, lambda _: None), None) is None


def _as_before(database: PhotoDatabase, options: SessionOptions) -> bool:
    """Whether positions and control points are those that the session was last gone on with."""
    before = json.loads(database.recall(_OPTIONS) or "{}")
    now, default = as_dict(options), as_dict(SessionOptions())
    # What is absent was the default: an earlier version did not know it.
    same = all({**default[name], **before.get(name, {})} == now[name] for name in _ANEW)
    return same and before.get(_FILES) in (None, _contents(options))


def _contents(options: SessionOptions) -> str:
    """What tells the files of positions and control points from others of the same names."""
    digest = hashlib.blake2b(digest_size=16)
    for file in (Path(options.positions.source), options.control_points.file):
        # One that cannot be read is told where it is used.
        with suppress(OSError):
            digest.update(b"" if file is None else file.read_bytes())
    return digest.hexdigest()


def _same(before: FileState, now: FileState) -> bool:
    return (before.size, before.mtime_ns) == (now.size, now.mtime_ns)


def as_dict(options: SessionOptions) -> dict[str, Any]:
    """Options as JSON has them."""
    found: dict[str, Any] = json.loads(as_json(asdict(options)))
    return found


def _differences(
    before: Mapping[str, Any], now: Mapping[str, Any], prefix: str = ""
) -> Iterable[tuple[str, Any, Any]]:
    """Dotted name, old and new value of what differs; options of one version only are passed."""
    for name in now:
        if name not in before or name in _FREE:
            continue
        full = f"{prefix}{name}"
        if isinstance(before[name], dict) and isinstance(now[name], dict):
            yield from _differences(before[name], now[name], f"{full}.")
        elif before[name] != now[name]:
            yield full, before[name], now[name]
