"""Similarities of space, many at a time: rotation, scale and shift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.types import Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class Similarities:
    """H of them: ``scales`` (H,), ``rotations`` (H, 3, 3) and ``translations`` (H, 3)."""

    scales: Float64Array
    rotations: Float64Array
    translations: Float64Array

    @classmethod
    def between(cls, source: Float64Array, target: Float64Array) -> Similarities:
        """Those that fit best from H sets of N points (H, N, 3) to others, in the sense of least
        squares; nan where the points of a set coincide.

        S. Umeyama, "Least-squares estimation of transformation parameters between two point
        patterns", PAMI 1991.
        """
        means = source.mean(axis=1), target.mean(axis=1)
        centred = source - means[0][:, None], target - means[1][:, None]
        left, singular, right = np.linalg.svd(np.einsum("hni,hnj->hij", centred[1], centred[0]))
        signs = np.ones_like(singular)
        signs[:, 2] = np.sign(np.linalg.det(left) * np.linalg.det(right))
        rotations = np.einsum("hij,hj,hjk->hik", left, signs, right)
        with np.errstate(divide="ignore", invalid="ignore"):
            scales = (singular * signs).sum(axis=1) / (centred[0] ** 2).sum(axis=(1, 2))
            moved = scales[:, None] * np.einsum("hij,hj->hi", rotations, means[0])
        return cls(scales, rotations, means[1] - moved)

    @classmethod
    def of(cls, similarities: Sequence[pycolmap.Sim3d]) -> Similarities:
        """Those that pycolmap has."""
        return cls(
            np.array([one.scale for one in similarities], np.float64),
            np.array([one.rotation.matrix() for one in similarities], np.float64),
            np.array([one.translation for one in similarities], np.float64),
        )

    @classmethod
    def joined(cls, parts: Sequence[Similarities]) -> Similarities:
        """All of them in one."""
        return cls(
            np.concatenate([part.scales for part in parts]),
            np.concatenate([part.rotations for part in parts]),
            np.concatenate([part.translations for part in parts]),
        )

    def __len__(self) -> int:
        return len(self.scales)

    def __getitem__(self, index: int | slice) -> Similarities:
        """Some of them, still as H."""
        chosen = slice(index, index + 1) if isinstance(index, int) else index
        return Similarities(self.scales[chosen], self.rotations[chosen], self.translations[chosen])

    def __call__(self, points: Float64Array) -> Float64Array:
        """(N, 3) → (H, N, 3): the points moved by each."""
        turned = np.einsum("hij,nj->hni", self.rotations, points)
        with np.errstate(invalid="ignore"):
            moved: Float64Array = self.scales[:, None, None] * turned + self.translations[:, None]
        return moved

    def inverse(self) -> Similarities:
        """The ways back."""
        turned_back = self.rotations.transpose(0, 2, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            scales = 1 / self.scales
        back = np.einsum("hij,hj->hi", turned_back, self.translations)
        return Similarities(scales, turned_back, -scales[:, None] * back)

    def only(self) -> pycolmap.Sim3d:
        """The first, as pycolmap has it."""
        rotation = pycolmap.Rotation3d(self.rotations[0])
        return pycolmap.Sim3d(float(self.scales[0]), rotation, self.translations[0])
