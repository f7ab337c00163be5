"""The similarity that most positions agree with, and by how much model and GPS differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sfm_front.geometry.similarity import Similarities
from sfm_front.georeference.fixes import BoolArray, Fixes
from sfm_front.georeference.levelling import LevelCameras
from sfm_front.types import Float64Array

# Samples of three: with five wrong among nine, some 10 of these are clean.
_HYPOTHESES = 128
# Positions on which they are compared.
_COMPARED = 120
# What the difference of model and GPS may be in metres, beyond the standard deviations: a drifting
# receiver, a bent model. Steps may be wide, as the scatter is estimated afterwards.
_FLOORS_M = tuple((plane, height) for plane in (0, 1, 4, 16) for height in (0, 4, 16, 64))
# A wrong position lies anywhere in a box of this size: east, north and up.
_BOX_M = (1000.0, 1000.0, 200.0)

SHARED = 3.0
"""So many fixes count as one where they are set against other evidence: neighbours share errors."""


@dataclass(frozen=True, slots=True)
class Floor:
    """Standard deviations in metres, of east and north each and of heights, on top of those that
    fixes claim."""

    plane_m: float
    height_m: float

    def variances(self, fixes: Fixes) -> Float64Array:
        """(N, 3) of the fixes' errors, inf for heights that are not known."""
        both: Float64Array = (
            fixes.sigmas**2 + np.array([self.plane_m, self.plane_m, self.height_m]) ** 2
        )
        return both


def find_consensus(
    centres: Float64Array, fixes: Fixes, level: LevelCameras | None, seed: int
) -> tuple[Similarities, Floor]:
    """enu_from_model that best explains the fixes, and the floor of their errors.

    Hypotheses come from three camera centres (N, 3) and their fixes each, or from two where level
    cameras show the way up. Together with the floor they are scored by likelihood: a fix is right,
    with its standard deviations and the floor, or wrong and anywhere (P. Torr & A. Zisserman,
    "MLESAC", CVIU 2000). At least three fixes.
    """
    rng = np.random.default_rng(seed)
    with_height = np.flatnonzero(fixes.known[:, 2])
    drawn_from = with_height if len(with_height) >= 3 else np.arange(len(fixes))
    first = rng.integers(0, len(drawn_from), (_HYPOTHESES, 1))
    steps = rng.integers(1, len(drawn_from), (_HYPOTHESES, 2))
    samples = drawn_from[np.hstack([first, first + steps]) % len(drawn_from)]
    hypotheses = [
        Similarities.between(centres[chosen], fixes.enu[chosen])
        for chosen in (samples, drawn_from[None])
    ]
    if level is not None and level.up is not None:
        pairs = samples[:, :2]
        hypotheses.append(_between_pairs(centres[pairs], fixes.enu[pairs], level.up))
    tried = Similarities.joined(hypotheses)
    compared = np.sort(rng.permutation(len(fixes))[:_COMPARED])
    some = fixes[compared]
    plane, height = _squares(tried, centres[compared], some)
    floors = [Floor(*floor) for floor in _FLOORS_M]
    odds = (_log_odds(plane, height, some, floor) for floor in floors)
    scores = np.array([np.maximum(each, 0).sum(axis=1) for each in odds]) / SHARED
    if level is not None:
        scores -= level.costs(tried) / 2
    scores[~np.isfinite(scores)] = -np.inf  # of points that coincide
    floor, best = np.unravel_index(scores.argmax(), scores.shape)
    return tried[int(best)], floors[int(floor)]


def likeliest_floor(similarity: Similarities, centres: Float64Array, fixes: Fixes) -> Floor:
    """The floor of the fixes' errors that best explains what a similarity leaves."""
    squares = _squares(similarity, centres, fixes)
    floors = [Floor(*floor) for floor in _FLOORS_M]
    scores = [np.maximum(_log_odds(*squares, fixes, floor), 0).sum() for floor in floors]
    return floors[int(np.argmax(scores))]


def agreeing(
    similarity: Similarities, centres: Float64Array, fixes: Fixes, floor: Floor
) -> BoolArray:
    """(N,) which fixes are more likely right than wrong."""
    right: BoolArray = _log_odds(*_squares(similarity, centres, fixes), fixes, floor)[0] > 0
    return right


def _squares(
    similarities: Similarities, centres: Float64Array, fixes: Fixes
) -> tuple[Float64Array, Float64Array]:
    """(H, N) squared distances of fixes and cameras in the plane and in height, in m²."""
    turned = (similarities.rotations.reshape(-1, 3) @ centres.T).reshape(-1, 3, len(centres))
    with np.errstate(invalid="ignore"):
        moved = similarities.scales[:, None, None] * turned + similarities.translations[:, :, None]
    squares = (fixes.enu.T - moved) ** 2
    return squares[:, 0] + squares[:, 1], squares[:, 2]


def _log_odds(
    plane: Float64Array, height: Float64Array, fixes: Fixes, floor: Floor
) -> Float64Array:
    """(H, N) logarithm of how much more likely right than wrong, from squared distances (H, N)."""
    variances = floor.variances(fixes)
    constant = np.where(fixes.known, np.log(_BOX_M) - np.log(2 * np.pi * variances) / 2, 0.0)
    weights = 0.5 / variances
    odds: Float64Array = constant.sum(axis=1) - plane * weights[:, 0] - height * weights[:, 2]
    return odds


def _between_pairs(source: Float64Array, target: Float64Array, up: Float64Array) -> Similarities:
    """From pairs of points (H, 2, 3), and the way up of the first ones."""
    east = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    east /= np.linalg.norm(east)
    upright = np.array([east, np.cross(up, east), up])
    stood = source @ upright.T
    vectors = stood[:, 1] - stood[:, 0], target[:, 1] - target[:, 0]
    first, second = (vector[:, 0] + 1j * vector[:, 1] for vector in vectors)
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = second / first
        scales = np.abs(turns)
        cosines, sines = turns.real / scales, turns.imag / scales
    zeros, ones = np.zeros(len(turns)), np.ones(len(turns))
    headings = np.stack([cosines, -sines, zeros, sines, cosines, zeros, zeros, zeros, ones], axis=1)
    rotations = headings.reshape(-1, 3, 3) @ upright
    moved = scales[:, None] * np.einsum("hij,hj->hi", rotations, source.mean(axis=1))
    return Similarities(scales, rotations, target.mean(axis=1) - moved)
