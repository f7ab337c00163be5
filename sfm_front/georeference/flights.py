"""Heights that are off by one amount for a whole flight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sfm_front.geometry.similarity import Similarities
from sfm_front.georeference.consensus import Floor, agreeing
from sfm_front.georeference.fitting import Fit, fit
from sfm_front.georeference.fixes import BoolArray, Fixes, IntArray
from sfm_front.georeference.levelling import LevelCameras
from sfm_front.types import Float64Array

# Photos with a height that a flight needs to have an offset of its own.
_MIN_PHOTOS = 4
# What each offset must explain of the squared residuals, in variances of independent fixes: one in
# a hundred thousand explains as much by chance.
_MIN_EXPLAINED = 20.0
# Neighbours within a flight are taken to share at least so much of their errors.
_MIN_CORRELATION = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class FlightFit:
    """``offsets``: metres by which a flight's heights are above those of the ``reference``, the
    flight of most photos. ``inliers`` (N,): what it was fitted to."""

    fit: Fit
    offsets: dict[int, float]
    reference: int
    inliers: BoolArray


def flight_height_offsets(
    start: Similarities,
    centres: Float64Array,
    fixes: Fixes,
    floor: Floor,
    level: LevelCameras | None,
) -> FlightFit | None:
    """The fit with an offset for each flight but one, or None where the data do not ask for it.

    ``start`` fits without offsets, or fits one flight only. A flight whose heights are off may have
    tilted it or been taken for wrong, so every photo counts that is right in east and north, and
    near the others of its flight in height.
    """
    measured = fixes.known[:, 2]
    labels, counts = np.unique(fixes.flights[measured], return_counts=True)
    labels, counts = labels[counts >= _MIN_PHOTOS], counts[counts >= _MIN_PHOTOS]
    if len(labels) < 2:
        return None
    reference = int(labels[counts.argmax()])
    others = labels[labels != reference]
    columns = (fixes.flights[:, None] == others).astype(np.float64)
    heights = fixes.enu[:, 2] - start(centres)[0][:, 2]
    first_guess = {
        int(label): float(np.median(heights[measured & (fixes.flights == label)]))
        for label in labels
    }
    similarity, offsets = start, first_guess
    for _ in range(2):
        raised = fixes.raised(offsets)
        inliers = agreeing(similarity, centres, raised, floor)
        if not all(np.sum(inliers & (fixes.flights == label)) >= 3 for label in labels):
            return None
        chosen = centres[inliers], fixes[inliers], floor
        with_offsets = fit(similarity, *chosen, level, columns[inliers])
        similarity = with_offsets.similarity
        offsets = dict(zip(others.tolist(), with_offsets.offsets.tolist(), strict=True))
    without = fit(start, *chosen, level, np.zeros((int(inliers.sum()), 0)))
    if not _borne_out(with_offsets, without, fixes.flights[inliers]):
        return None
    return FlightFit(with_offsets, offsets, reference, inliers)


def _borne_out(with_offsets: Fit, without: Fit, flights: IntArray) -> bool:
    """Whether the residuals shrink by more than chance has them shrink."""
    sigmas = with_offsets.sigmas
    explained = np.sum((without.residuals / sigmas) ** 2) - np.sum(
        (with_offsets.residuals / sigmas) ** 2
    )
    heights = with_offsets.residuals[:, 2]
    together = flights[1:] == flights[:-1]
    shared = np.sum((heights[1:] * heights[:-1])[together])
    correlation = shared / max(np.sum(heights**2), np.finfo(float).tiny)
    correlation = min(max(correlation, _MIN_CORRELATION), 0.99)
    independent = (1 - correlation) / (1 + correlation)
    return bool(explained * independent > _MIN_EXPLAINED * len(with_offsets.offsets))
