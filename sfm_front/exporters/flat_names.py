"""Names of photos → names that every reader takes, all in one folder."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from pathlib import PurePosixPath

_LONGEST = 80


def flat_stems(names: Iterable[str]) -> dict[str, str]:
    """Name → file name without its suffix; no two alike, whether upper or lower case.

    Folders are joined by an underscore. ASCII letters and digits, ``-`` and ``_`` stay, letters
    lose their accents, all else becomes an underscore: blanks end a name in COLMAP's, Bundler's and
    VisualSFM's files; Inria's reader cuts it at its first dot and fails at letters of two bytes. A
    plain name stays as it is.
    """
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        wanted = _plain(name)
        stem, number = wanted, 1
        while stem.lower() in taken:
            number += 1
            stem = f"{wanted}_{number}"
        taken.add(stem.lower())
        stems[name] = stem
    return stems


def _plain(name: str) -> str:
    path = PurePosixPath(name)
    letters = unicodedata.normalize("NFKD", str(path.with_suffix("")) if path.name else name)
    kept = (c for c in letters if not unicodedata.combining(c))
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "_" for c in kept)
    plain = plain[-_LONGEST:] or "photo"
    # A leading hyphen would make an option of it.
    return f"_{plain[1:]}" if plain.startswith("-") else plain
