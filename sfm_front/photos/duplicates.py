"""Photos that are the same file as an earlier one."""

from __future__ import annotations

from collections.abc import Mapping

from sfm_front.types import Skipped, SkipReason


class DuplicateFinder:
    """Tells photos that are byte for byte the same as an earlier one.

    ``known`` maps the digests of a session that is resumed to the photos' names. Ask in the order
    in which photos arrive, from one thread: the first of several copies is the one that is kept.
    """

    def __init__(self, known: Mapping[str, str] | None = None) -> None:
        self._name_by_digest = dict(known or {})

    def check(self, name: str, digest: str) -> Skipped | None:
        """Skipped if an earlier photo of another name has this digest; None remembers this one."""
        first = self._name_by_digest.setdefault(digest, name)
        if first == name:
            return None
        return Skipped(name, SkipReason.DUPLICATE, f"same file as {first}")
