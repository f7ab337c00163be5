"""Arrays on disk by key: written whole or not at all; unreadable files count as absent."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sfm_front.storage.atomic import write_atomically

_KEY = re.compile(r"[0-9a-f]{32}")

Arrays = Mapping[str, NDArray[Any]]


class ArrayFiles:
    """Named arrays under keys of 32 hexadecimal digits, one ``KEY.npz`` per key.

    No pickle is read or written. Threads and processes may share a folder: each sees a file either
    before or after another's write, never during it.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def load(self, key: str) -> Arrays | None:
        """The arrays under ``key``; None if there are none or the file is damaged."""
        try:
            with np.load(self._path(key), allow_pickle=False) as arrays:
                return {name: arrays[name] for name in arrays.files}
        # numpy raises a different exception for each kind of damage.
        except (OSError, ValueError, TypeError, EOFError, KeyError, zipfile.BadZipFile):
            return None

    def save(self, key: str, arrays: Arrays) -> None:
        """Store ``arrays``. Raises InputError if the folder cannot be written to."""
        write_atomically(self._path(key), lambda file: np.savez(file, **arrays))  # type: ignore[arg-type]

    def has(self, key: str) -> bool:
        return self._path(key).is_file()

    def keep_only(self, keys: Collection[str]) -> None:
        """Remove what is stored under other keys; other files are left alone."""
        kept = set(keys)
        for path in self._folder.glob("*.npz"):
            if _KEY.fullmatch(path.stem) and path.stem not in kept:
                path.unlink(missing_ok=True)

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}.npz"
