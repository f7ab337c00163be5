"""Positions of photos that hold a model together with control points."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pycolmap

from sfm_front.georeference.control.adjustment import (
    HeldCamera,
    HeldPoint,
    adjust_with_control,
)
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions, median_error
from sfm_front.mapping.position_priors import PositionPriors, PriorOptions
from sfm_front.mapping.taking_over import take_over
from sfm_front.types import Float64Array

# Adjustments at most; from each it is seen better by how much all positions are off, up to this
# share of their standard deviations.
_ROUNDS = 4
_CLOSE = 0.1
# Median of distances of positions, in standard deviations, that contradicts the rest: 1.5 is right.
_TOO_FAR = 3.0
# Of what is left to be seen, what an offset lacks: at first, and at most.
_FIRST_FACTOR, _MOST_FACTOR = 5.0, 100.0
_LEAST_ERROR_PX = 1e-9


class PositionsBeside:
    """What positions add where control points are few or far.

    Receivers are off by metres, all photos of a flight alike, and points by centimetres. So points
    say where the model is, and positions how it goes on from there: one offset of them all is found
    that leaves no mean residual.
    """

    def __init__(self, model: pycolmap.Reconstruction, positions: PositionPriors | None) -> None:
        self._model = model
        known = {} if positions is None else positions.positions
        self._image_ids = [i for i in sorted(model.reg_image_ids()) if i in known]
        self._enu = np.array([known[i] for i in self._image_ids]).reshape(-1, 3)
        sigmas = {} if positions is None else positions.sigmas
        self._sigmas = np.array([sigmas[i] for i in self._image_ids]).reshape(-1, 3)

    def hold(
        self,
        points: Sequence[HeldPoint],
        adjustment: RobustAdjustmentOptions,
        pixel_sigma: float,
    ) -> int:
        """Adjust the model, which points alone hold so far, with them and positions; returns how
        many of these: none if they contradict points or photos, and the model is as it was."""
        if not self._image_ids:
            return 0
        exact = replace(adjustment, tolerance=adjustment.large_tolerance)
        before, error = copy.deepcopy(self._model), median_error(self._model)
        offset = self._mean(self._residuals(np.zeros(3)))
        step, last = np.zeros(3), np.zeros(3)
        for _ in range(_ROUNDS):
            cameras = list(map(HeldCamera, self._image_ids, self._enu - offset, self._sigmas))
            adjust_with_control(self._model, points, exact, pixel_sigma, cameras)
            left = self._mean(self._residuals(offset))
            step, last = _next_step(step, last, left), left
            offset = offset + step
            if (np.abs(step) < _CLOSE * self._sigmas.min(axis=0)).all():
                break
        distances = np.linalg.norm(self._residuals(offset) / self._sigmas, axis=1)
        rise = median_error(self._model) / max(error, _LEAST_ERROR_PX) - 1
        if float(np.median(distances)) > _TOO_FAR or rise > PriorOptions().max_error_rise:
            take_over(self._model, before)
            self._model.update_point_3d_errors()
            return 0
        return len(self._image_ids)

    def _residuals(self, offset: Float64Array) -> Float64Array:
        """(P, 3) of positions, less ``offset``, against where their photos are now."""
        images = map(self._model.image, self._image_ids)
        centres = np.array([image.projection_center() for image in images])
        residuals: Float64Array = self._enu - offset - centres
        return residuals

    def _mean(self, residuals: Float64Array) -> Float64Array:
        """(3,) by how exact each is."""
        weights = self._sigmas**-2
        mean: Float64Array = (weights * residuals).sum(axis=0) / weights.sum(axis=0)
        return mean


def _next_step(step: Float64Array, before: Float64Array, after: Float64Array) -> Float64Array:
    """(3,) what an offset lacks, where the last ``step`` has brought residuals from ``before`` to
    ``after``.

    Models follow positions, more or less: of what an offset is wrong by, little is left to be seen.
    """
    factors = np.full(3, _FIRST_FACTOR)
    np.divide(step, before - after, out=factors, where=(step != 0) & (before != after))
    lacking: Float64Array = after * np.clip(factors, 1.0, _MOST_FACTOR)
    return lacking
