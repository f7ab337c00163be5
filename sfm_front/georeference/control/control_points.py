"""A model onto its control points, and how far it then is from them and from checkpoints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.control.adjustment import HeldPoint, adjust_with_control
from sfm_front.georeference.control.alignment import align_to_surveyed
from sfm_front.georeference.control.marks import PhotoMark
from sfm_front.georeference.control.options import ControlOptions
from sfm_front.georeference.control.point_file import MIN_POINTS, ControlPoint
from sfm_front.georeference.control.positions_beside import PositionsBeside
from sfm_front.georeference.control.residuals import (
    ControlAccuracy,
    PointResidual,
    PointRole,
    accuracy_of,
    residual_of,
)
from sfm_front.georeference.control.surveyed import surveyed_in
from sfm_front.georeference.control.triangulation import MarkedPlace, Sighting, triangulate
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions, median_error
from sfm_front.mapping.position_priors import PositionPriors
from sfm_front.types import Float64Array

BoolArray = NDArray[np.bool_]

# Of the length of an error in two dimensions, over its standard deviation along one: Rayleigh's.
_MEAN_LENGTH = 1.2533
# Adjustments at most, each with other points left out.
_MAX_ROUNDS = 4
# Median of the points' distances from where they should be, in standard deviations, above which
# it is these that are stated wrongly; and what it should be: 1.2 in two dimensions, 1.5 in three.
_TOO_FAR = 3.0
_MEDIAN_DISTANCE = 1.35


@dataclass(frozen=True, slots=True, eq=False)
class ControlResult:
    """A model that control points hold.

    ``enu_from_model``: from the model as it was given, before it was adjusted; ``sigma_factor``: 1,
    or how much larger than stated the points' errors are; ``num_positions`` of photos hold it, too;
    ``error_before_px`` and ``error_after_px``: medians of its points' reprojection errors.
    """

    enu_from_model: pycolmap.Sim3d
    points: tuple[PointResidual, ...]
    control: ControlAccuracy
    checkpoints: ControlAccuracy
    sigma_factor: float
    num_positions: int
    error_before_px: float
    error_after_px: float


@dataclass(frozen=True, slots=True)
class NotControlled:
    """Why control points could not hold a model, which is as it was."""

    reason: str

    def __str__(self) -> str:
        return self.reason


def hold_to_control_points(
    reconstruction: pycolmap.Reconstruction,
    points: Sequence[ControlPoint],
    marks: Sequence[PhotoMark],
    frame: LocalFrame,
    options: ControlOptions,
    adjustment: RobustAdjustmentOptions,
    *,
    is_metric: bool,
    positions: PositionPriors | None = None,
) -> ControlResult | NotControlled:
    """Move the model into the frame and adjust it with its control points; checkpoints are only
    measured.

    ``is_metric``: it is in the frame already, by the positions of its photos. Heights that the file
    does not give are then taken from it, loosely; else such points are taken to lie in about one
    level. Points that fit neither the others nor the photos are left out.

    ``positions`` of photos in the frame hold the model as well, where no points are; see
    ``PositionsBeside``.
    """
    beside = PositionsBeside(reconstruction, positions)
    control = _Control(reconstruction, points, marks, frame, options, is_metric, beside)
    return control.hold(adjustment)


class _Control:
    def __init__(
        self,
        model: pycolmap.Reconstruction,
        points: Sequence[ControlPoint],
        marks: Sequence[PhotoMark],
        frame: LocalFrame,
        options: ControlOptions,
        is_metric: bool,
        beside: PositionsBeside,
    ) -> None:
        self._model = model
        self._beside = beside
        self._points = points
        self._options = options
        images = {model.image(i).name: model.image(i) for i in model.reg_image_ids()}
        self._marks = [
            [m for m in marks if m.point == p.name and m.photo in images] for p in points
        ]
        self._sightings = [
            [Sighting(images[m.photo], np.array([m.x, m.y])) for m in of_point]
            for of_point in self._marks
        ]
        self._surveyed = surveyed_in(points, frame, options)
        self._places = self._triangulated()
        if is_metric:
            heights = [np.nan if place is None else place.xyz[2] for place in self._places]
            self._surveyed.assume(np.array(heights), options.unknown_height_sigma_m)

    def hold(self, adjustment: RobustAdjustmentOptions) -> ControlResult | NotControlled:
        measured = np.array([place is not None for place in self._places])
        control = measured & ~np.array([point.is_checkpoint for point in self._points])
        if control.sum() < MIN_POINTS:
            return NotControlled(
                f"{control.sum()} control points have marks that agree in two photos of this model "
                f"or more; at least {MIN_POINTS} are needed."
            )
        xyz = np.array([place.xyz for place in self._places if place is not None])
        alignment = align_to_surveyed(xyz[control[measured]], self._surveyed[control])
        if alignment is None:
            return NotControlled(
                f"The {control.sum()} control points in this model lie on a line, round which it "
                "could turn."
            )
        before = median_error(self._model)
        enu_from_model = alignment.enu_from_model.only()
        self._model.transform(enu_from_model)
        self._places = self._triangulated()
        held = np.zeros(len(control), bool)
        held[control] = alignment.agree
        factor = 1.0
        for _ in range(_MAX_ROUNDS):
            pixel_sigma = self._pixel_sigma()
            adjust_with_control(self._model, self._held(held, factor), adjustment, pixel_sigma)
            self._places = self._triangulated()
            off = self._off(control, pixel_sigma, factor)
            common = float(np.median(off[held]))
            if common > _TOO_FAR:
                factor *= common / _MEDIAN_DISTANCE
                continue
            fitting = self._fitting(off, held, control)
            if fitting.sum() < MIN_POINTS or (fitting == held).all():
                break
            held = fitting
        num_positions = self._beside.hold(self._held(held, factor), adjustment, self._pixel_sigma())
        self._places = self._triangulated()
        residuals = tuple(self._residual(i, bool(held[i])) for i in range(len(self._points)))
        return ControlResult(
            enu_from_model=enu_from_model,
            points=residuals,
            control=accuracy_of(residuals, PointRole.CONTROL),
            checkpoints=accuracy_of(residuals, PointRole.CHECKPOINT),
            sigma_factor=factor,
            num_positions=num_positions,
            error_before_px=before,
            error_after_px=median_error(self._model),
        )

    def _triangulated(self) -> list[MarkedPlace | None]:
        limit = self._options.max_mark_error_px
        return [triangulate(sightings, limit) for sightings in self._sightings]

    def _held(self, held: BoolArray, factor: float) -> list[HeldPoint]:
        return [
            HeldPoint(
                self._surveyed.enu[i],
                self._surveyed.sigmas_of(i, factor),
                place.xyz,
                [s for s, good in zip(self._sightings[i], place.agree, strict=True) if good],
            )
            for i, place in enumerate(self._places)
            if held[i] and place is not None
        ]

    def _pixel_sigma(self) -> float:
        """Of keypoints and marks, from how well they fit."""
        return max(median_error(self._model) / _MEAN_LENGTH, 1e-3)

    def _mark_sigma(self, pixel_sigma: float) -> float:
        """Of marks: by hand they are less exact than keypoints."""
        agreeing = [p.residuals_px[p.agree] for p in self._places if p is not None]
        squares = sum(float((residuals**2).sum()) for residuals in agreeing)
        free = sum(2 * len(residuals) - 3 for residuals in agreeing)
        return max(pixel_sigma, float(np.sqrt(squares / free)) if free else 0.0)

    def _off(self, control: BoolArray, pixel_sigma: float, factor: float) -> Float64Array:
        """(N,) how far control points are from where they should be, in standard deviations of
        survey and marks; inf where that is not known."""
        mark_sigma = self._mark_sigma(pixel_sigma)
        off = np.full(len(control), np.inf)
        for i in np.flatnonzero(control).tolist():
            place = self._places[i]
            if place is None:
                continue
            axes = 3 if self._surveyed.has_height[i] else 2
            residual = (place.xyz - self._surveyed.enu[i])[:axes]
            spread = mark_sigma**2 * place.covariance + np.diag(
                self._surveyed.sigmas_of(i, factor) ** 2
            )
            off[i] = np.sqrt(residual @ np.linalg.solve(spread[:axes, :axes], residual))
        return off

    def _fitting(self, off: Float64Array, held: BoolArray, control: BoolArray) -> BoolArray:
        """Those held, without the worst one if it does not fit, else with all others that do."""
        fits = control & np.less(off, self._options.max_sigmas)
        if fits[held].all():
            return fits
        fitting: BoolArray = held.copy()
        fitting[np.argmax(np.where(held, off, -1.0))] = False
        return fitting

    def _residual(self, index: int, is_held: bool) -> PointResidual:
        return residual_of(
            self._points[index],
            self._marks[index],
            self._places[index],
            self._surveyed.enu[index],
            PointRole.CONTROL if is_held else PointRole.LEFT_OUT,
        )
