"""A file that lists overlapping photos → what is relevant to a query."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from sfm_front.errors import InputError


class GroundTruth:
    """Names relevant to every query, and pairs of names relevant to each other."""

    def __init__(self, names: Collection[str], pairs: Collection[tuple[str, str]]) -> None:
        self._names = frozenset(names)
        self._pairs = frozenset(pairs)

    def of(self, query: str) -> frozenset[str] | None:
        """The names relevant to ``query``; None if nothing is known about it."""
        paired = {b if a == query else a for a, b in self._pairs if query in (a, b)}
        known = self._names | paired
        return known - {query} if known else None


def read_ground_truth(file: Path, photos: Collection[str]) -> GroundTruth:
    """Read names of relevant photos, one per line, or pairs as lines ``a b n`` (n shared points).

    ``photos``: the names of all photos. Empty lines and lines starting with # are ignored.
    Raises InputError if the file cannot be read or names none of the photos.
    """
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text in UTF-8"
        raise InputError(
            f"{file}: cannot be read ({reason}). Give a text file with one relevant photo per line."
        ) from error
    known = frozenset(photos)
    names: set[str] = set()
    pairs: set[tuple[str, str]] = set()
    for line in map(str.strip, text.splitlines()):
        parts = line.split()
        # A name may hold spaces and end in a number, so look for the whole line first.
        if line in known:
            names.add(line)
        elif len(parts) == 3 and parts[2].isdigit() and not line.startswith("#"):
            pairs.add((parts[0], parts[1]))
    if not names and not any(a in known or b in known for a, b in pairs):
        raise InputError(
            f"{file}: names none of the {len(known)} photos. Give one name per line, relative to "
            "the folder, or lines of two names and the number of points they share."
        )
    return GroundTruth(names, pairs)
