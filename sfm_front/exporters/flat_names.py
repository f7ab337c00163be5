"""Names of photos → names that every reader takes, all in one folder."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from pathlib import PurePosixPath

_LONGEST = 80


def flat_stems(names: Iterable[str]) -> dict[str, str]:
    """Name → file name without its suffix; no two alike, whether upper or lower case.

    Folders are joined by an underscore. Letters and digits of any script, ``-`` and ``_`` stay;
    all else becomes an underscore: blanks end a name in COLMAP's, Bundler's and VisualSFM's files,
    and readers of splats cut it at its first dot. A plain name stays as it is.
    """
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        wanted = _plain(name)
        stem, number = wanted, 1
        while stem.casefold() in taken:
            number += 1
            stem = f"{wanted}_{number}"
        taken.add(stem.casefold())
        stems[name] = stem
    return stems


def _plain(name: str) -> str:
    without_suffix = str(PurePosixPath(name).with_suffix("")) if PurePosixPath(name).name else name
    letters = unicodedata.normalize("NFC", without_suffix)
    plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in letters)[-_LONGEST:]
    # A leading hyphen would make an option of it.
    return f"_{plain[1:]}" if plain.startswith("-") else plain or "photo"
