"""What the colours of points say: what photos show, or a quantity along a ramp, with its legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sfm_front.types import Float64Array

if TYPE_CHECKING:
    import pycolmap

COLORINGS = {
    "rgb": "what the photos show",
    "photo": "the first photo that sees it, in the colour of its frustum",
    "track": "how many photos see it",
    "error": "its mean reprojection error",
    "height": "how high it lies",
}
"""By name: what a point's colour says."""

#: Low to high, or first photo to last: blue, teal, yellow, red; visible on dark and on white.
_RAMP = np.array([[0.20, 0.47, 0.96], [0.06, 0.72, 0.65], [0.95, 0.70, 0.10], [0.93, 0.25, 0.22]])
#: What lies outside has the colour of the limit: a few wrong points would take all of the ramp.
_PERCENTILES = (2.0, 98.0)


def ramp(at: Float64Array) -> Float64Array:
    """(N,) in [0, 1] → (N, 3) float64 RGB in [0, 1]."""
    stops = np.linspace(0.0, 1.0, len(_RAMP))
    return np.stack([np.interp(at, stops, channel) for channel in _RAMP.T], axis=1)


def sequence_colors(count: int) -> Float64Array:
    """(count, 3) float64: one colour per photo, running through the sequence."""
    return ramp(np.linspace(0.0, 1.0, count))


def point_colors(
    points: Sequence[pycolmap.Point3D],
    image_ids: Sequence[int],
    coloring: str,
    up: Float64Array,
    grey: float,
) -> tuple[Float64Array, str]:
    """(N, 3) float64 of ``points``, and what the ramp says in words; no words without a ramp.

    ``image_ids``: of the photos in the order of the sequence; ``coloring``: a key of ``COLORINGS``;
    ``up`` (3,): of the model's world, length 1; ``grey``: where the model has no colours.
    """
    if not points:
        return np.zeros((0, 3)), ""
    if coloring == "rgb":
        colors = np.array([point.color for point in points]) / 255.0
        return (colors if colors.any() else np.full_like(colors, grey)), ""
    if coloring == "photo":
        place = {image_id: number for number, image_id in enumerate(image_ids)}
        # Models of other programs may have points that no photo sees: the last row.
        of_photo = np.vstack([sequence_colors(len(image_ids)), np.full(3, grey)])
        seen = [[place.get(e.image_id, -1) for e in p.track.elements] for p in points]
        first = [min((n for n in numbers if n >= 0), default=-1) for numbers in seen]
        return of_photo[first], "the first photo that sees a point: first blue, last red"
    if coloring == "track":
        lengths = np.array([point.track.length() for point in points], float)
        # Few photos are the doubtful ones, as large errors are.
        return _along(-lengths), _legend("photos that see a point", lengths, "{:.0f}", low="red")
    if coloring == "error":
        errors = np.array([point.error for point in points])
        return _along(errors), _legend("reprojection error", errors, "{:.2f} px")
    heights = np.array([point.xyz for point in points]) @ up
    return _along(heights), _legend("height", heights, "{:.4g}")


def _along(values: Float64Array) -> Float64Array:
    low, high = np.percentile(values, _PERCENTILES)
    return ramp(np.clip((values - low) / max(high - low, 1e-12), 0.0, 1.0))


def _legend(what: str, values: NDArray[np.float64], form: str, low: str = "blue") -> str:
    limits = [form.format(limit) for limit in np.percentile(values, _PERCENTILES)]
    high = "red" if low == "blue" else "blue"
    return f"{what}: {limits[0]} {low}, {limits[1]} {high}"
