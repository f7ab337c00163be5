"""Matches a photo with all its candidates in one batch with torch, for GPUs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sfm_front.matching.nearest_neighbors import NO_MATCHES, SQUARED_NORM, MatchingOptions
from sfm_front.types import Features, Uint32Array

if TYPE_CHECKING:
    import torch

# Similarities held at once: 2 GiB of float32.
_MAX_SIMILARITIES = 2**29


class TorchMatcher:
    """Finds the matches that ``match_descriptors`` and ``match_rotated`` find.

    Similarities are integers below 2^24, which float32 products give exactly. TensorFloat-32 would
    not; torch leaves it off for matrix products by default.
    """

    def __init__(self, options: MatchingOptions, device: str) -> None:
        self._options = options
        self._device = device

    def match(
        self,
        query: Features,
        others: Sequence[Features],
        rotations_rad: Sequence[float | None],
    ) -> list[Uint32Array]:
        """See ``matcher.Matcher``."""
        if len(query) < 2:
            return [NO_MATCHES] * len(others)
        longest = max((len(other) for other in others), default=1)
        at_once = max(1, _MAX_SIMILARITIES // (len(query) * max(longest, 1)))
        found: list[Uint32Array] = []
        for start in range(0, len(others), at_once):
            chosen = slice(start, start + at_once)
            found += self._match_batch(query, others[chosen], rotations_rad[chosen])
        return found

    def _match_batch(
        self, query: Features, others: Sequence[Features], rotations_rad: Sequence[float | None]
    ) -> list[Uint32Array]:
        import torch

        with torch.inference_mode():
            similarity = self._similarities(query, others, rotations_rad)
            two, nearest_two = similarity.topk(2, dim=2)
            best, runner_up = two.unbind(dim=2)
            nearest = nearest_two[:, :, 0]
            best_of_second = similarity.amax(dim=1)
            angle, next_angle = _angle(best), _angle(runner_up)
            kept = (
                (angle <= self._options.max_angle_rad)
                & (angle < self._options.max_ratio * next_angle)
                & (best == best_of_second.gather(1, nearest))
            )
            return [
                _first_of_each(kept_of_pair.cpu().numpy(), nearest_of_pair.cpu().numpy())
                for kept_of_pair, nearest_of_pair in zip(kept, nearest, strict=True)
            ]

    def _similarities(
        self, query: Features, others: Sequence[Features], rotations_rad: Sequence[float | None]
    ) -> torch.Tensor:
        """(pairs, N, M) float32; -1 where two features must not match or one does not exist."""
        import torch

        width = max(2, *(len(other) for other in others))
        descriptors = torch.zeros((len(others), width, 128), device=self._device)
        exists = torch.zeros((len(others), 1, width), dtype=torch.bool, device=self._device)
        for pair, other in enumerate(others):
            descriptors[pair, : len(other)] = self._send(other.descriptors).float()
            exists[pair, 0, : len(other)] = True
        similarity = self._send(query.descriptors).float() @ descriptors.transpose(1, 2)
        similarity.masked_fill_(~exists, -1)
        for pair, rotation_rad in enumerate(rotations_rad):
            if rotation_rad is not None and len(others[pair]) > 0:
                allowed = self._allowed(query, others[pair], rotation_rad)
                similarity[pair, :, : len(others[pair])].masked_fill_(~allowed, -1)
        return similarity

    def _allowed(self, query: Features, other: Features, rotation_rad: float) -> torch.Tensor:
        """(N, M) bool: the pairs that ``rotation_mask`` allows."""
        import torch

        rotation = self._options.rotation
        sector_rad = 2 * math.pi / rotation.num_sectors
        expected = torch.remainder(self._send(query.keypoints[:, 3]) + rotation_rad, 2 * math.pi)
        middle = (torch.floor(expected / sector_rad) + 0.5) * sector_rad
        apart = middle[:, None] - self._send(other.keypoints[:, 3])[None]
        apart = torch.remainder(apart + math.pi, 2 * math.pi) - math.pi
        allowed: torch.Tensor = apart.abs() <= sector_rad / 2 + rotation.tolerance_rad
        return allowed

    def _send(self, array: np.ndarray) -> torch.Tensor:
        import torch

        return torch.from_numpy(np.ascontiguousarray(array)).to(self._device)


def _angle(similarity: torch.Tensor) -> torch.Tensor:
    return (similarity / SQUARED_NORM).clamp(max=1).arccos()


def _first_of_each(kept: np.ndarray, nearest: np.ndarray) -> Uint32Array:
    """(K, 2) kept matches; of query features with the same nearest neighbour, the first one."""
    rows = np.flatnonzero(kept)
    _, once = np.unique(nearest[rows], return_index=True)
    rows = rows[np.sort(once)]
    return np.stack([rows, nearest[rows]], axis=1).astype(np.uint32)
