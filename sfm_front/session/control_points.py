"""The control points of a session: checked as its photos come, and held to at its end."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import astuple, replace

import numpy as np
import pycolmap

from sfm_front.errors import InputError
from sfm_front.events import ControlPointsRefused, Emit, HeldToControlPoints
from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.georeference.control.control_points import (
    ControlResult,
    NotControlled,
    hold_to_control_points,
)
from sfm_front.georeference.control.marks import PhotoMark, Size, last_part, marks_in_photos
from sfm_front.georeference.control.options import ControlOptions
from sfm_front.georeference.control.point_file import ControlPoint, read_control_points
from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.surveyed import frame_at
from sfm_front.mapping.model import Model
from sfm_front.mapping.position_priors import PositionPriors
from sfm_front.session.georeferencing import Georeferencing

# Between control points and the photos that positions have put somewhere: further apart, one of
# both is in another reference system than stated.
_MAX_APART_M = 10_000.0


class ControlPoints:
    """Read from their file, if there is one.

    ``report``: what became of them, once ``hold`` has been called; None if there are none.
    """

    def __init__(self, options: ControlOptions, emit: Emit) -> None:
        """Raises InputError or DependencyError if there is a file that cannot be used."""
        self._options = options
        self._emit = emit
        self._points = [] if options.file is None else read_control_points(options.file)
        self._marked = {mark.photo for point in self._points for mark in point.marks}
        self._sizes: dict[str, Size] = {}
        self._refused = ""
        self.report: ControlReport | None = None

    def take(self, name: str, size: Size) -> None:
        """Look at the marks in a photo, new or restored: the first thing that is wrong is told now,
        while it can be mended."""
        self._sizes[name] = size
        if self._refused:
            return
        if name not in self._marked and last_part(name) not in self._marked:
            return
        try:
            marks_in_photos(self._points, {name: size}, self._options.marked_size)
        except InputError as error:
            self._refuse(str(error))

    def hold(self, models: Sequence[Model], georeferencing: Georeferencing) -> None:
        """Move the largest finished model that sees enough points into their frame, and adjust it
        with them; if something is wrong with them, all models stay as they are."""
        if self._options.file is None:
            return
        report = ControlReport(file=self._options.file.name)
        try:
            marks, missing = marks_in_photos(self._points, self._sizes, self._options.marked_size)
        except InputError as error:
            self.report = replace(report, not_used=str(error))
        else:
            report = replace(report, missing_photos=tuple(missing))
            self.report = self._hold(report, marks, models, georeferencing)
        if self.report.not_used:
            self._refuse(self.report.not_used)

    def _hold(
        self,
        report: ControlReport,
        marks: Sequence[PhotoMark],
        models: Sequence[Model],
        georeferencing: Georeferencing,
    ) -> ControlReport:
        frame = georeferencing.frame_of(models) or frame_at(self._points)
        why_not = ""
        for number, model in enumerate(models):
            result = self._held(model, marks, frame, georeferencing.priors_of(model))
            if isinstance(result, NotControlled):
                why_not = why_not or result.reason  # that of the largest
                continue
            reason = f"held to {result.control.count} control points"
            if result.num_positions:
                reason += f" and {result.num_positions} positions of photos"
            georeferencing.held_to_control(model, frame, result.enu_from_model, reason)
            told = result.checkpoints if result.checkpoints.count else result.control
            self._emit(
                HeldToControlPoints(
                    model_id=model.model_id,
                    origin=astuple(frame),
                    num_control=result.control.count,
                    num_checkpoints=result.checkpoints.count,
                    ce90_m=told.ce90_m,
                    le90_m=told.le90_m,
                )
            )
            return replace(
                report,
                model=number,
                points=result.points,
                control=result.control,
                checkpoints=result.checkpoints,
                sigma_factor=result.sigma_factor,
                error_before_px=result.error_before_px,
                error_after_px=result.error_after_px,
            )
        return replace(report, not_used=why_not or "There is no model.")

    def _held(
        self,
        model: Model,
        marks: Sequence[PhotoMark],
        frame: LocalFrame,
        positions: PositionPriors | None,
    ) -> ControlResult | NotControlled:
        """The model moves only if they can hold it."""
        adjusted = copy.deepcopy(model.reconstruction)
        is_metric = model.is_georeferenced
        if is_metric and (apart_m := _apart_m(adjusted, self._points, frame)) > _MAX_APART_M:
            return NotControlled(
                f"The points are {apart_m / 1000:.0f} km from where the photos were taken by their "
                "own positions. Correct the reference system in the first line of the file, or "
                "give --gps off."
            )
        result = hold_to_control_points(
            adjusted,
            self._points,
            marks,
            frame,
            self._options,
            model.robust,
            is_metric=is_metric,
            positions=positions,
        )
        if isinstance(result, ControlResult):
            model.adopt(adjusted)
        return result

    def _refuse(self, reason: str) -> None:
        if reason != self._refused:
            self._refused = reason
            self._emit(ControlPointsRefused(reason))


def _apart_m(
    reconstruction: pycolmap.Reconstruction, points: Sequence[ControlPoint], frame: LocalFrame
) -> float:
    """The smallest distance between points and cameras of a model in this frame."""
    places = lat_lon_alt(point.position for point in points)
    places[np.isnan(places[:, 2]), 2] = frame.altitude_m
    centres = np.array(
        [reconstruction.image(i).projection_center() for i in reconstruction.reg_image_ids()]
    )
    offsets = frame.to_enu(places)[:, None] - centres[None]
    return float(np.linalg.norm(offsets, axis=2).min())
