"""The photo folders of a session, and what precedes the names of each one's photos."""

from __future__ import annotations

import json
from collections.abc import Collection
from itertools import chain, count
from pathlib import Path

from sfm_front.photos.cameras import folder_of
from sfm_front.storage.database import PhotoDatabase

_KEY = "sources"


class PhotoFolders:
    """Names are those below the folder. Photos of every further folder are named after it, too:
    any name may still appear in either."""

    def __init__(self, database: PhotoDatabase) -> None:
        """The folders are kept in the database."""
        self._database = database

    @property
    def prefixes(self) -> dict[str, str]:
        """Folder → what precedes its names, in the order in which they came."""
        found: dict[str, str] = json.loads(self._database.recall(_KEY) or "{}")
        return found

    def prefix(self, folder: Path, names: Collection[str]) -> str:
        """What precedes the names of a resolved folder; chosen when its first photos come.

        ``names``: all that are taken then.
        """
        prefixes = self.prefixes
        if str(folder) not in prefixes:
            prefixes[str(folder)] = _free(folder.name, prefixes.values(), names)
            self._database.remember(_KEY, json.dumps(prefixes))
        return prefixes[str(folder)]

    def folder_of(self, name: str) -> str:
        """The folder of a photo below the one it came from.

        Photos at the top of two folders may be of one camera, as if they had come in one.
        """
        own = (prefix for prefix in self.prefixes.values() if name.startswith(prefix))
        return folder_of(name.removeprefix(max(own, key=len, default="")))


def _free(folder: str, prefixes: Collection[str], names: Collection[str]) -> str:
    numbered = (f"{folder}{number or ''}/" for number in count())
    return next(
        prefix
        for prefix in chain([""], numbered)
        if prefix not in prefixes and not any(name.startswith(prefix) for name in names)
    )
