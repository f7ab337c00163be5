"""Tentative matches of one photo with several others, on CPU cores or on a GPU."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from sfm_front.matching.nearest_neighbors import MatchingOptions, match_descriptors, match_rotated
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.types import Features, Uint32Array


class Matcher(Protocol):
    """All implementations return the same matches, up to rounding at sector edges."""

    def match(
        self,
        query: Features,
        others: Sequence[Features],
        rotations_rad: Sequence[float | None],
    ) -> list[Uint32Array]:
        """For each other photo (K, 2) uint32: keypoint indices in the query and in the other.

        ``rotations_rad``: in-plane rotation of each other photo against the query, so that only
        features that agree with it are compared; None if it is unknown.
        """
        ...


class CpuMatcher:
    """Matches pairs in parallel, one per thread."""

    def __init__(self, options: MatchingOptions, workers: WorkerPool) -> None:
        self._options = options
        self._workers = workers

    def match(
        self,
        query: Features,
        others: Sequence[Features],
        rotations_rad: Sequence[float | None],
    ) -> list[Uint32Array]:
        """See ``Matcher``."""

        def match_one(pair: tuple[Features, float | None]) -> Uint32Array:
            other, rotation_rad = pair
            if rotation_rad is None:
                return match_descriptors(query.descriptors, other.descriptors, self._options)
            return match_rotated(query, other, rotation_rad, self._options)

        return self._workers.map(match_one, zip(others, rotations_rad, strict=True))


def make_matcher(device: str, options: MatchingOptions, workers: WorkerPool) -> Matcher:
    """The matcher for a device from ``devices.usable_device``."""
    if device == "cpu":
        return CpuMatcher(options, workers)
    from sfm_front.matching.torch_matcher import TorchMatcher

    return TorchMatcher(options, device)
