"""Epipolar planes of two photos with known poses, and which features may match under them.

A feature's match lies in the half-plane that its ray spans with the baseline, the line through both
projection centres. One angle around the baseline identifies a half-plane in both photos, whatever
the distortion and wherever the epipoles are: polar rectification, as in Pollefeys, Koch and Van
Gool, "A simple and efficient rectification method for general motion", ICCV 1999.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sfm_front.geometry.angles import FULL_TURN, wrapped
from sfm_front.matching.match_mask import MaskBlock, MatchMask
from sfm_front.types import Float64Array, Uint32Array

_ROWS = 128


class EpipolarPlanes:
    """The epipolar half-planes that the rays of two photos lie in.

    ``baseline`` (3,): from the first projection centre to the second, not 0. ``rays1`` (N, 3) and
    ``rays2`` (M, 3): of length 1, in the same frame; nan if a feature has none.
    """

    def __init__(self, baseline: Float64Array, rays1: Float64Array, rays2: Float64Array) -> None:
        axis = baseline / np.linalg.norm(baseline)
        across = _across(axis, np.nan_to_num(rays1).sum(axis=0))
        self._angle1, self._sine1 = _around(rays1 @ across)
        self._angle2, self._sine2 = _around(rays2 @ across)

    def distances_rad(self, matches: Uint32Array) -> Float64Array:
        """(K,) angle of the second ray of each match (K, 2) to the half-plane of the first ray.

        inf if either ray is missing.
        """
        apart = self._angle2[matches[:, 1]] - self._angle1[matches[:, 0]]
        distances: Float64Array = self._sine2[matches[:, 1]] * np.abs(wrapped(apart))
        return np.nan_to_num(distances, nan=np.inf)

    def mask(self, band_rad: float, *, min_sine: float) -> MatchMask:
        """Each feature of the first photo may match those of the second this close to its plane.

        ``min_sine``: features whose ray has a smaller sine of the angle to the baseline match none.
        """
        order1 = _sorted_indices(self._angle1, self._sine1, min_sine)
        order2 = _sorted_indices(self._angle2, self._sine2, min_sine)
        angle, reach = self._angle2[order2], band_rad / self._sine2[order2]
        # The circle is cut opposite to where the first photo looks. Features within reach of the
        # cut are listed on both sides of it.
        below, above = angle - reach < -np.pi, angle + reach > np.pi
        angle = np.concatenate([angle, angle[below] + FULL_TURN, angle[above] - FULL_TURN])
        reach = np.concatenate([reach, reach[below], reach[above]])
        order2 = np.concatenate([order2, order2[below], order2[above]])
        return MatchMask(
            order1, order2, _blocks(self._angle1[order1], angle - reach, angle + reach)
        )


def _across(axis: Float64Array, ahead: Float64Array) -> Float64Array:
    """(3, 2) two directions orthogonal to the axis, the first as close to ``ahead`` as possible."""
    ahead = ahead - (ahead @ axis) * axis
    if np.linalg.norm(ahead) == 0:
        ahead = np.linalg.svd(axis[None])[2][1]
    ahead = ahead / np.linalg.norm(ahead)
    return np.stack([ahead, np.cross(axis, ahead)], axis=1)


def _around(rays: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Angle around the axis, from -pi to pi, and sine of the angle to it, for rays (N, 2)."""
    return np.arctan2(rays[:, 1], rays[:, 0]), np.hypot(rays[:, 0], rays[:, 1])


def _sorted_indices(angle: Float64Array, sine: Float64Array, min_sine: float) -> np.ndarray:
    """Indices of the features whose plane is well defined, sorted by angle."""
    known = np.flatnonzero(sine >= min_sine)
    return known[np.argsort(angle[known], kind="stable")]


def _blocks(angle: Float64Array, low: Float64Array, high: Float64Array) -> Iterator[MaskBlock]:
    """Sorted angles (N,) against intervals from ``low`` to ``high`` (M,), some rows at a time."""
    row, first, last = (array.astype(np.float32) for array in (angle, low, high))
    for start in range(0, len(row), _ROWS):
        rows = slice(start, min(start + _ROWS, len(row)))
        columns = np.flatnonzero((first <= row[rows.stop - 1]) & (last >= row[rows.start]))
        own = row[rows, None]
        yield MaskBlock(rows, columns, (first[columns] <= own) & (own <= last[columns]))
