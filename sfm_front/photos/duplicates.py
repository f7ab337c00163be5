"""Find photos whose file equals an earlier photo's."""

from __future__ import annotations

from collections.abc import Mapping

from sfm_front.types import Skipped, SkipReason


class DuplicateFinder:
    """Finds photos that are byte for byte the same as an earlier one.

    ``known`` maps digests to names, for the earlier photos of a resumed session. Check photos in
    order of arrival, from one thread: the first of several copies is kept.
    """

    def __init__(self, known: Mapping[str, str] | None = None) -> None:
        self._name_by_digest = dict(known or {})

    def check(self, name: str, digest: str) -> Skipped | None:
        """Skipped if an earlier photo of another name has this digest; else None, and the photo
        is remembered."""
        first = self._name_by_digest.setdefault(digest, name)
        if first == name:
            return None
        return Skipped(name, SkipReason.DUPLICATE, f"same file as {first}")
