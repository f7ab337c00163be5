"""Richer lenses at the end, and a principal point off the middle, where photos bear them out."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pycolmap

from sfm_front.geometry.lenses import LADDER, grown, is_one_to_one, simplified, take_intrinsics
from sfm_front.mapping.bundle_adjustment import (
    RobustAdjustmentOptions,
    adjust_robustly,
    median_error,
)
from sfm_front.mapping.calibration import CalibrationOptions, photos_by_camera
from sfm_front.mapping.lens_evidence import LensEvidence, Param

FREE = {
    "SIMPLE_PINHOLE": (Param.FOCAL,),
    "PINHOLE": (Param.FOCAL, Param.ASPECT),
    "SIMPLE_RADIAL": (Param.FOCAL, Param.K1),
    "RADIAL": (Param.FOCAL, Param.K1, Param.K2),
    "OPENCV": (Param.FOCAL, Param.ASPECT, Param.K1, Param.K2, Param.P1, Param.P2),
}
"""What is refined of a camera model, its principal point aside; the focal length first."""
_PRINCIPAL_POINT = (Param.CX, Param.CY)
# What a principal point must bring even alone, in steps: turned photos make up for a wrong one, and
# a few wrong matches move it (TUNING: lens-gain).
_PRINCIPAL_POINT_STEPS = 1.5


@dataclass(frozen=True, slots=True)
class Lens:
    """A model that a camera may have at the end, and whether its principal point moves."""

    model: str
    moves_principal_point: bool = False

    @property
    def params(self) -> tuple[Param, ...]:
        """What is refined of it."""
        return FREE[self.model] + (_PRINCIPAL_POINT if self.moves_principal_point else ())


@dataclass(frozen=True, eq=False)
class GrownModel:
    """A model with the lenses that are borne out.

    ``focal_sigmas``: standard deviation of the focal length as a share of it, by camera id, of
    those that have photos enough; see ``LensEvidence.focal_sigma``.
    """

    reconstruction: pycolmap.Reconstruction
    focal_sigmas: Mapping[int, float]


def with_grown_lenses(
    reconstruction: pycolmap.Reconstruction,
    options: CalibrationOptions,
    adjustment: RobustAdjustmentOptions,
) -> GrownModel:
    """A model with richer lenses where they are better, adjusted with them, or the one given.

    That one has been adjusted, on some of its points at least, and its errors are up to date.

    First it is computed what each lens would explain of the residuals, poses and points moving
    along: a fraction of what an adjustment takes. Tangential distortion and a principal point off
    the middle look alike, so they are weighed against each other, never one after the other. Only
    what promises enough is tried, on a copy, and kept if the median error falls as much as is asked
    for each step. The median: wrong matches, which no lens explains, move the mean.
    """
    evidence: dict[int, LensEvidence] = {}
    for camera_id, image_ids in photos_by_camera(reconstruction).items():
        if len(image_ids) >= options.min_photos:
            found = LensEvidence.of(reconstruction, camera_id)
            if found is not None:
                evidence[camera_id] = found
    plan = _plan(reconstruction, evidence, options) if adjustment.refine_intrinsics else {}
    while plan:
        tried = _adjusted(reconstruction, plan, adjustment)
        if _is_borne_out(tried, reconstruction, plan, options):
            return GrownModel(tried, _focal_sigmas(reconstruction, evidence, plan))
        steps = max(_steps(reconstruction.camera(i), lens) for i, lens in plan.items())
        plan = _plan(reconstruction, evidence, options, at_most=steps - 1)
    return GrownModel(reconstruction, _focal_sigmas(reconstruction, evidence, {}))


def _focal_sigmas(
    reconstruction: pycolmap.Reconstruction,
    evidence: Mapping[int, LensEvidence],
    plan: Mapping[int, Lens],
) -> dict[int, float]:
    return {
        camera_id: found.focal_sigma(
            plan.get(camera_id, Lens(reconstruction.camera(camera_id).model_name)).params
        )
        for camera_id, found in evidence.items()
    }


def simplify_lenses(
    reconstruction: pycolmap.Reconstruction,
    cameras: Mapping[int, pycolmap.Camera],
    adjustment: RobustAdjustmentOptions,
) -> None:
    """Give a finished model that is to go on growing the simple lenses of these ``cameras``, by id,
    and their principal points.

    All models over one view graph must have the same; its own were richer if they had grown. What
    few photos bore out must not stay because more of them promise little beyond it.
    """
    are_others = False
    for camera_id, camera in reconstruction.cameras.items():
        first = cameras[camera_id]
        if camera.model != first.model:
            take_intrinsics(camera, simplified(camera, first.model_name))
            are_others = True
        if _principal_point(camera) != _principal_point(first):
            camera.principal_point_x, camera.principal_point_y = _principal_point(first)
            are_others = True
    if are_others:
        adjust_robustly(reconstruction, adjustment, principal_point=False)


def _principal_point(camera: pycolmap.Camera) -> tuple[float, float]:
    return camera.principal_point_x, camera.principal_point_y


def _plan(
    reconstruction: pycolmap.Reconstruction,
    evidence: Mapping[int, LensEvidence],
    options: CalibrationOptions,
    at_most: float = math.inf,
) -> dict[int, Lens]:
    """Camera id → the lens that promises most and is at most so many steps up, where one does."""
    # An adjustment moves all principal points or none.
    may_move = len(photos_by_camera(reconstruction)) == 1
    plan = {}
    for camera_id, found in evidence.items():
        camera = reconstruction.camera(camera_id)
        lenses = [
            lens for lens in _lenses(camera, options, may_move) if _steps(camera, lens) <= at_most
        ]
        lens = _most_promising(found, camera, lenses, options)
        if lens is not None:
            plan[camera_id] = lens
    return plan


def _lenses(camera: pycolmap.Camera, options: CalibrationOptions, may_move: bool) -> list[Lens]:
    """What a camera may become."""
    models = [camera.model_name]
    if options.grow_lens and camera.model_name in LADDER:
        models = list(LADDER[LADDER.index(camera.model_name) :])
    lenses = [Lens(model, moves) for moves in (False, True)[: 1 + may_move] for model in models]
    return lenses[1:]


def _most_promising(
    evidence: LensEvidence,
    camera: pycolmap.Camera,
    lenses: Sequence[Lens],
    options: CalibrationOptions,
) -> Lens | None:
    """The lens that promises most beyond what its steps must bring, of those that do; else the
    one that promises nearly enough."""
    unexplained = 1 - evidence.explained(Lens(camera.model_name).params)
    best, most = None, (False, -math.inf)
    for lens in lenses:
        fall = 1 - (1 - evidence.explained(lens.params)) / unexplained
        asked = _asked(camera, lens, options)
        if fall < options.promise_share * asked:
            continue
        beyond = fall - options.min_gain * _steps(camera, lens)
        rank = (True, beyond) if fall >= asked else (False, fall / asked)
        if rank > most and evidence.focal_sigma(lens.params) <= options.max_focal_sigma:
            best, most = lens, rank
    return best


def _adjusted(
    reconstruction: pycolmap.Reconstruction,
    plan: Mapping[int, Lens],
    adjustment: RobustAdjustmentOptions,
) -> pycolmap.Reconstruction:
    """A copy, adjusted with these lenses."""
    tried = copy.deepcopy(reconstruction)
    for camera_id, lens in plan.items():
        camera = tried.camera(camera_id)
        take_intrinsics(camera, grown(camera, lens.model))
    moves = any(lens.moves_principal_point for lens in plan.values())
    adjust_robustly(tried, adjustment, principal_point=moves)
    return tried


def _steps(camera: pycolmap.Camera, lens: Lens) -> int:
    """How far a lens is from the one that a camera has."""
    up = 0
    if lens.model != camera.model_name:
        up = LADDER.index(lens.model) - LADDER.index(camera.model_name)
    return up + lens.moves_principal_point


def _asked(camera: pycolmap.Camera, lens: Lens, options: CalibrationOptions) -> float:
    """By what share the median error must fall."""
    least = _PRINCIPAL_POINT_STEPS if lens.moves_principal_point else 0
    return options.min_gain * max(_steps(camera, lens), least)


def _is_borne_out(
    tried: pycolmap.Reconstruction,
    before: pycolmap.Reconstruction,
    plan: Mapping[int, Lens],
    options: CalibrationOptions,
) -> bool:
    asked = min(_asked(before.camera(i), lens, options) for i, lens in plan.items())
    seen_by = set(plan) if len(photos_by_camera(before)) > len(plan) else None
    if median_error(tried, seen_by) > (1 - asked) * median_error(before, seen_by):
        return False
    return all(_is_plausible(tried.camera(camera_id), options) for camera_id in plan)


def _is_plausible(camera: pycolmap.Camera, options: CalibrationOptions) -> bool:
    shift_px = math.dist(_principal_point(camera), (camera.width / 2, camera.height / 2))
    limits = pycolmap.IncrementalMapperOptions()
    return (
        shift_px <= options.max_shift * max(camera.width, camera.height)
        and not camera.has_bogus_params(
            limits.min_focal_length_ratio, limits.max_focal_length_ratio, limits.max_extra_param
        )
        and is_one_to_one(camera)
    )
