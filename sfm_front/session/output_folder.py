"""The folder a session writes to: what is in it, and what of that may be replaced."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.exporters.colmap import STATE
from sfm_front.georeference.sidecar import FILE_NAME as SIDECAR
from sfm_front.reports import event_log, html, report_json, retrieval_log
from sfm_front.storage.atomic import is_partial
from sfm_front.storage.database import DATABASE
from sfm_front.storage.session_lock import SessionLock

_MARKER = retrieval_log.FILE
_FILES = (
    DATABASE,
    f"{DATABASE}-shm",
    f"{DATABASE}-wal",
    event_log.FILE,
    report_json.FILE,
    html.FILE,
    html.SCENE_FILE,
    _MARKER,
)
_MODELS = ("sparse", "sparse.new", "sparse.old")
WORKING_FOLDER = "cluster"
"""What workers of a cluster have made, until it is in the output itself."""

_WORKING = frozenset({"features", "vectors", "models", "token"})
_MODEL_NAME = re.compile(r"\d+")
_MODEL_FILES = frozenset(
    {
        "points3D.ply",
        *(
            f"{part}{suffix}"
            for part in ("cameras", "frames", "images", "points3D", "rigs")
            for suffix in (".bin", ".txt")
        ),
    }
)


def check_output_folder(output: Path, *, overwrite: bool, resume: bool = False) -> None:
    """Raise InputError unless a session may write to ``output``. Changes nothing.

    An output is a session's own if ``retrieval.jsonl``, which every session begins with, is in it.
    Only such an output is replaced or, with ``resume``, continued, and only if its model folders
    hold nothing but model files.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: not a folder. Give another --output.")
    taken = [name for name in (*_FILES, *_MODELS, WORKING_FOLDER) if _is_there(output / name)]
    if not taken:
        return
    if not _is_own_file(output / _MARKER):
        raise InputError(
            f"{output}: holds {taken[0]}, which this tool did not write. "
            "Move it away, or give another --output."
        )
    if not overwrite and not resume:
        raise InputError(
            f"{output}: holds a reconstruction already. Give another --output, "
            "or --overwrite to replace it."
        )
    for foreign in _foreign(output):
        raise InputError(
            f"{foreign}: lies where --overwrite would remove it, and this tool did not write it. "
            "Move it away, or give another --output."
        )


def open_output_folder(output: Path, *, overwrite: bool, resume: bool = False) -> SessionLock:
    """Make the folder if need be, and lock it for this process.

    Removes what an earlier session wrote if ``overwrite``. Raises InputError as
    ``check_output_folder`` does, if the folder cannot be made or written to, or if another process
    writes to it.
    """
    check_output_folder(output, overwrite=overwrite, resume=resume)
    try:
        output.mkdir(parents=True, exist_ok=True)
        # Try before removing anything: a read-only output must stay as it is.
        (output / _MARKER).touch()
    except OSError as error:
        raise _unwritable(output, error) from error
    lock = SessionLock(output)
    try:
        if overwrite:
            _clear(output)
        _remove_partial(output)
    except OSError as error:
        lock.close()
        raise _unwritable(output, error) from error
    return lock


def holds_session(output: Path) -> bool:
    """Whether a session has begun to write to this folder."""
    return _is_own_file(output / _MARKER) and _is_own_file(output / DATABASE)


def remove_working_folder(output: Path) -> None:
    """What workers made is in the output itself."""
    shutil.rmtree(output / WORKING_FOLDER, ignore_errors=True)


def _clear(output: Path) -> None:
    """Remove what a session wrote; the marker stays, so that a second try may replace the rest."""
    for name in (*_MODELS, WORKING_FOLDER):
        if (output / name).is_dir():
            shutil.rmtree(output / name)
    for name in _FILES:
        if name != _MARKER:
            (output / name).unlink(missing_ok=True)


def _remove_partial(output: Path) -> None:
    """Remove what killed processes had begun to write; only for who holds the lock."""
    for path in output.iterdir():
        if any(is_partial(path.name, name) for name in _FILES) and _is_own_file(path):
            path.unlink()


def _unwritable(output: Path, error: OSError) -> InputError:
    return InputError(f"{output}: cannot be written to ({error.strerror}). Give another --output.")


def _is_there(path: Path) -> bool:
    return path.exists() or path.is_symlink()


def _is_own_file(path: Path) -> bool:
    return path.is_file() and not path.is_symlink()


def _foreign(output: Path) -> Iterator[Path]:
    """What a session would not have written, in the places that are removed."""
    for name in _FILES:
        path = output / name
        if _is_there(path) and not _is_own_file(path):
            yield path
    yield from _foreign_working(output / WORKING_FOLDER)
    for name in _MODELS:
        folder = output / name
        if not _is_there(folder):
            continue
        if folder.is_symlink() or not folder.is_dir():
            yield folder
            continue
        for model in folder.iterdir():
            is_ours = any(
                model.name == name or is_partial(model.name, name) for name in (STATE, SIDECAR)
            )
            if is_ours and _is_own_file(model):
                continue
            if model.is_symlink() or not model.is_dir() or not _MODEL_NAME.fullmatch(model.name):
                yield model
                continue
            for file in model.iterdir():
                if file.name not in _MODEL_FILES or not _is_own_file(file):
                    yield file


def _foreign_working(folder: Path) -> Iterator[Path]:
    if not _is_there(folder):
        return
    if folder.is_symlink() or not folder.is_dir():
        yield folder
        return
    for path in folder.iterdir():
        if path.name not in _WORKING and not is_partial(path.name, "token"):
            yield path
