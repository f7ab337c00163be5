"""Tentative matches of one photo with several others: on the processor's cores, or on a GPU."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from sfm_front.matching.nearest_neighbors import MatchingOptions, match, match_turned
from sfm_front.runtime.worker_pool import Workers
from sfm_front.types import Features, Uint32Array


class Matcher(Protocol):
    """Whoever does it, the matches are the same, but for rounding on the edge of a sector."""

    def match(
        self,
        query: Features,
        others: Sequence[Features],
        turns_rad: Sequence[float | None],
    ) -> list[Uint32Array]:
        """For each other photo (K, 2) uint32: keypoint indices in the query and in the other.

        ``turns_rad``: how far each other is turned against the query, so that only features that
        agree with it meet; None where that is not known.
        """
        ...


class CpuMatcher:
    """A pair a thread."""

    def __init__(self, options: MatchingOptions, workers: Workers) -> None:
        self._options = options
        self._workers = workers

    def match(
        self,
        query: Features,
        others: Sequence[Features],
        turns_rad: Sequence[float | None],
    ) -> list[Uint32Array]:
        """See ``Matcher``."""

        def match_one(pair: tuple[Features, float | None]) -> Uint32Array:
            other, turn_rad = pair
            if turn_rad is None:
                return match(query.descriptors, other.descriptors, self._options)
            return match_turned(query, other, turn_rad, self._options)

        return self._workers.map(match_one, zip(others, turns_rad, strict=True))


def make_matcher(device: str, options: MatchingOptions, workers: Workers) -> Matcher:
    """For a device that ``devices.usable_device`` has given."""
    if device == "cpu":
        return CpuMatcher(options, workers)
    from sfm_front.matching.torch_matcher import TorchMatcher

    return TorchMatcher(options, device)
