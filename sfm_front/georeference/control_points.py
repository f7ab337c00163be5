"""A model onto its control points, and how far it then is from them and from checkpoints."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.georeference.control_adjustment import HeldPoint, adjust_with_control
from sfm_front.georeference.control_alignment import Surveyed, align_to_surveyed
from sfm_front.georeference.control_point_file import MIN_POINTS, ControlPoint
from sfm_front.georeference.mark_triangulation import MarkedPlace, Sighting, triangulate
from sfm_front.georeference.photo_marks import PhotoMark
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions
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
# What an unknown height may be off, as a share of the extent, where nothing else levels the model.
_FLATNESS = 0.02


@dataclass(frozen=True, kw_only=True)
class ControlOptions:
    """How exact control points and their marks are."""

    # Standard deviations where the file does not say: of east and of north each, and of heights.
    horizontal_sigma_m: float = 0.02
    vertical_sigma_m: float = 0.03
    # Reprojection error of a mark in another place than the others of its point: COLMAP's limit
    # for keypoints, in pixels of the photo.
    max_mark_error_px: float = 4.0
    # Residual of a point that was marked or surveyed wrongly, in standard deviations.
    max_sigmas: float = 4.0
    # By how much heights may be off that the file does not give, where positions of the photos
    # have levelled the model.
    unknown_height_sigma_m: float = 10.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0:
                raise ConfigError(f"{name} must be above 0, got {value}")


class PointRole(Enum):
    """What became of a point."""

    CONTROL = "control"
    CHECKPOINT = "checkpoint"
    LEFT_OUT = "left out"
    NOT_MEASURED = "not measured"


@dataclass(frozen=True, slots=True)
class MarkResidual:
    """Mark minus projection, nan where the point is not measured; ``agrees`` with the others."""

    photo: str
    x_px: float
    y_px: float
    agrees: bool


@dataclass(frozen=True, slots=True)
class PointResidual:
    """What the model says of a point, by its marks alone, less what the survey says, in metres.

    ``up_m`` is None without a surveyed height; all are if the point is not measured: fewer than
    two photos of the model have marks of it that agree.
    """

    name: str
    role: PointRole
    east_m: float | None
    north_m: float | None
    up_m: float | None
    marks: tuple[MarkResidual, ...]

    @property
    def horizontal_m(self) -> float | None:
        if self.east_m is None or self.north_m is None:
            return None
        return float(np.hypot(self.east_m, self.north_m))

    def __str__(self) -> str:
        wrong = ", ".join(
            f"mark in {mark.photo} off by {np.hypot(mark.x_px, mark.y_px):.1f} px"
            for mark in self.marks
            if not mark.agrees and np.isfinite(mark.x_px)
        )
        metres = ", ".join(
            f"{axis} {value:+.3f} m"
            for axis, value in (("east", self.east_m), ("north", self.north_m), ("up", self.up_m))
            if value is not None
        )
        return "; ".join(filter(None, [f"{self.name} ({self.role.value})", metres, wrong]))


@dataclass(frozen=True, slots=True)
class ControlAccuracy:
    """Over ``count`` points: root mean squares in metres, and what 90 % of the errors stay within,
    horizontally (CE90) and in height (LE90); None where no point says."""

    count: int
    east_rms_m: float | None
    north_rms_m: float | None
    up_rms_m: float | None
    ce90_m: float | None
    le90_m: float | None


@dataclass(frozen=True, slots=True, eq=False)
class ControlResult:
    """A model that control points hold.

    ``enu_from_model``: from the model as it was given, before it was adjusted; ``sigma_factor``: 1,
    or how much larger than stated the points' errors are; ``error_before_px``
    and ``error_after_px``: medians of its points' reprojection errors.
    """

    enu_from_model: pycolmap.Sim3d
    points: tuple[PointResidual, ...]
    control: ControlAccuracy
    checkpoints: ControlAccuracy
    sigma_factor: float
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
) -> ControlResult | NotControlled:
    """Move the model into the frame and adjust it with its control points; checkpoints are only
    measured.

    ``is_metric``: it is in the frame already, by the positions of its photos. Heights that the file
    does not give are then taken from it, loosely; else such points are taken to lie in about one
    level. Points that fit neither the others nor the photos are left out.
    """
    return _Control(reconstruction, points, marks, frame, options, is_metric).hold(adjustment)


class _Control:
    def __init__(
        self,
        model: pycolmap.Reconstruction,
        points: Sequence[ControlPoint],
        marks: Sequence[PhotoMark],
        frame: LocalFrame,
        options: ControlOptions,
        is_metric: bool,
    ) -> None:
        self._model = model
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
        self._surveyed = _surveyed(points, frame, options)
        self._places = self._triangulated()
        if is_metric:
            heights = [np.nan if place is None else place.xyz[2] for place in self._places]
            self._assume(np.array(heights), options.unknown_height_sigma_m)

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
        before = _median_error(self._model)
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
        residuals = tuple(self._residual(i, bool(held[i])) for i in range(len(self._points)))
        return ControlResult(
            enu_from_model=enu_from_model,
            points=residuals,
            control=_accuracy(residuals, PointRole.CONTROL),
            checkpoints=_accuracy(residuals, PointRole.CHECKPOINT),
            sigma_factor=factor,
            error_before_px=before,
            error_after_px=_median_error(self._model),
        )

    def _triangulated(self) -> list[MarkedPlace | None]:
        limit = self._options.max_mark_error_px
        return [triangulate(sightings, limit) for sightings in self._sightings]

    def _assume(self, heights: Float64Array, sigma_m: float) -> None:
        unknown = ~self._surveyed.has_height & np.isfinite(heights)
        self._surveyed.enu[unknown, 2] = heights[unknown]
        self._surveyed.sigmas[unknown, 2] = sigma_m

    def _held(self, held: BoolArray, factor: float) -> list[HeldPoint]:
        return [
            HeldPoint(
                self._surveyed.enu[i],
                self._sigmas(i, factor),
                place.xyz,
                [s for s, good in zip(self._sightings[i], place.agree, strict=True) if good],
            )
            for i, place in enumerate(self._places)
            if held[i] and place is not None
        ]

    def _sigmas(self, index: int, factor: float) -> Float64Array:
        """(3,) those stated times the factor, and those of assumed heights as they are."""
        factors = np.array([factor, factor, factor if self._surveyed.has_height[index] else 1.0])
        sigmas: Float64Array = factors * self._surveyed.sigmas[index]
        return sigmas

    def _pixel_sigma(self) -> float:
        """Of keypoints and marks, from how well they fit."""
        return max(_median_error(self._model) / _MEAN_LENGTH, 1e-3)

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
            spread = mark_sigma**2 * place.covariance + np.diag(self._sigmas(i, factor) ** 2)
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
        point, place = self._points[index], self._places[index]
        names = [mark.photo for mark in self._marks[index]]
        if place is None:
            marks = tuple(MarkResidual(name, np.nan, np.nan, False) for name in names)
            return PointResidual(point.name, PointRole.NOT_MEASURED, None, None, None, marks)
        east, north, up = (place.xyz - self._surveyed.enu[index]).tolist()
        role = PointRole.CONTROL if is_held else PointRole.LEFT_OUT
        return PointResidual(
            point.name,
            PointRole.CHECKPOINT if point.is_checkpoint else role,
            east,
            north,
            up if self._surveyed.has_height[index] else None,
            tuple(
                MarkResidual(name, float(x), float(y), bool(agrees))
                for name, (x, y), agrees in zip(names, place.residuals_px, place.agree, strict=True)
            ),
        )


def _surveyed(
    points: Sequence[ControlPoint], frame: LocalFrame, options: ControlOptions
) -> Surveyed:
    """In the frame; unknown heights are the mean of the others, or the frame's 0."""
    places = lat_lon_alt(point.position for point in points)
    has_height = np.isfinite(places[:, 2])
    level = places[has_height, 2].mean() if has_height.any() else frame.altitude_m
    places[~has_height, 2] = level
    enu = frame.to_enu(places)
    extent = float(np.linalg.norm(np.ptp(enu[:, :2], axis=0)))
    sigmas = np.array(
        [
            (
                point.position.horizontal_sigma_m or options.horizontal_sigma_m,
                point.position.horizontal_sigma_m or options.horizontal_sigma_m,
                (point.position.vertical_sigma_m or options.vertical_sigma_m)
                if known
                else _FLATNESS * extent,
            )
            for point, known in zip(points, has_height, strict=True)
        ]
    )
    return Surveyed(enu, sigmas, has_height)


def _accuracy(residuals: Sequence[PointResidual], role: PointRole) -> ControlAccuracy:
    chosen = [r for r in residuals if r.role is role]
    east = [r.east_m for r in chosen if r.east_m is not None]
    north = [r.north_m for r in chosen if r.north_m is not None]
    up = [r.up_m for r in chosen if r.up_m is not None]
    return ControlAccuracy(
        count=len(chosen),
        east_rms_m=_rms(east),
        north_rms_m=_rms(north),
        up_rms_m=_rms(up),
        ce90_m=_within_90(np.hypot(east, north)),
        le90_m=_within_90(np.abs(up)),
    )


def _rms(values: Sequence[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _within_90(errors: Float64Array) -> float | None:
    return float(np.percentile(errors, 90)) if len(errors) else None


def _median_error(reconstruction: pycolmap.Reconstruction) -> float:
    """Of its points' mean reprojection errors; 0 where there is no point."""
    errors = [float(point.error) for point in reconstruction.points3D.values()]
    return statistics.median(errors) if errors else 0.0
