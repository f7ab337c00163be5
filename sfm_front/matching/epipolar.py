"""Epipolar planes of two photos whose poses are known, and which features they let match.

A feature's match lies in the half-plane that its ray spans from the baseline, the line through
both centres. Half-planes are told apart by one angle around the baseline, the same for both photos,
whatever the distortion and wherever the epipoles lie: rectification in polar form, as in Pollefeys,
Koch and Van Gool, "A simple and efficient rectification method for general motion", ICCV 1999.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sfm_front.geometry.angles import FULL_TURN, wrapped
from sfm_front.matching.match_mask import MaskBlock, MatchMask
from sfm_front.types import Float64Array, Uint32Array

_ROWS = 128
# Sine of a ray's angle to the baseline, about 3 degrees. Nearer to an epipole planes are not told
# apart, and what both photos see there has hardly any parallax.
_MIN_SINE = 0.05


class EpipolarPlanes:
    """The half-planes from the baseline that the rays of two photos lie in.

    ``baseline`` (3,): from the first centre to the second, not 0. ``rays1`` (N, 3) and ``rays2``
    (M, 3): of length 1, in the same frame; nan for none.
    """

    def __init__(self, baseline: Float64Array, rays1: Float64Array, rays2: Float64Array) -> None:
        axis = baseline / np.linalg.norm(baseline)
        across = _across(axis, np.nan_to_num(rays1).sum(axis=0))
        self._angle1, self._sine1 = _around(rays1 @ across)
        self._angle2, self._sine2 = _around(rays2 @ across)

    def distances_rad(self, matches: Uint32Array) -> Float64Array:
        """(K,) angles by which the second ray of each match (K, 2) misses the first one's plane.

        inf where there is no ray.
        """
        apart = self._angle2[matches[:, 1]] - self._angle1[matches[:, 0]]
        distances: Float64Array = self._sine2[matches[:, 1]] * np.abs(wrapped(apart))
        return np.nan_to_num(distances, nan=np.inf)

    def mask(self, band_rad: float) -> MatchMask:
        """Each feature of the first photo meets those of the second this near to its plane."""
        order1, order2 = _in_order(self._angle1, self._sine1), _in_order(self._angle2, self._sine2)
        angle, reach = self._angle2[order2], band_rad / self._sine2[order2]
        # The circle is cut opposite to where the first photo looks; what lies within reach of the
        # cut is there on both sides of it.
        below, above = angle - reach < -np.pi, angle + reach > np.pi
        angle = np.concatenate([angle, angle[below] + FULL_TURN, angle[above] - FULL_TURN])
        reach = np.concatenate([reach, reach[below], reach[above]])
        order2 = np.concatenate([order2, order2[below], order2[above]])
        return MatchMask(
            order1, order2, _blocks(self._angle1[order1], angle - reach, angle + reach)
        )


def _across(axis: Float64Array, ahead: Float64Array) -> Float64Array:
    """(3, 2): two directions across the axis, the first the one most ahead."""
    ahead = ahead - (ahead @ axis) * axis
    if np.linalg.norm(ahead) == 0:
        ahead = np.linalg.svd(axis[None])[2][1]
    ahead = ahead / np.linalg.norm(ahead)
    return np.stack([ahead, np.cross(axis, ahead)], axis=1)


def _around(rays: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Angle around the axis, from -pi to pi, and sine of the angle to it, of rays (N, 2)."""
    return np.arctan2(rays[:, 1], rays[:, 0]), np.hypot(rays[:, 0], rays[:, 1])


def _in_order(angle: Float64Array, sine: Float64Array) -> np.ndarray:
    """Indices of those whose plane is known, by their angle."""
    known = np.flatnonzero(sine >= _MIN_SINE)
    return known[np.argsort(angle[known], kind="stable")]


def _blocks(angle: Float64Array, low: Float64Array, high: Float64Array) -> Iterator[MaskBlock]:
    """Rising angles (N,) against what reaches from low to high (M,), some rows at a time."""
    row, first, last = (array.astype(np.float32) for array in (angle, low, high))
    for start in range(0, len(row), _ROWS):
        rows = slice(start, min(start + _ROWS, len(row)))
        columns = np.flatnonzero((first <= row[rows.stop - 1]) & (last >= row[rows.start]))
        own = row[rows, None]
        yield MaskBlock(rows, columns, (first[columns] <= own) & (own <= last[columns]))
