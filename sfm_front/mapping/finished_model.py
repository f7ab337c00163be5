"""What becomes of a model when it is adjusted for the last time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pycolmap

from sfm_front.mapping.calibration import impossible_photos, is_miscalibrated
from sfm_front.mapping.final_adjustment import final_adjustment
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.mapping.position_priors import PositionPriors, held_to_positions


@dataclass(frozen=True, eq=False)
class FinishedModel:
    """``focal_sigmas``: see ``GrownModel``. ``is_held_to_positions``: whether the last adjustment
    kept to positions; None if it was not asked to."""

    reconstruction: pycolmap.Reconstruction
    focal_sigmas: Mapping[int, float]
    is_held_to_positions: bool | None = None


def finished_model(
    reconstruction: pycolmap.Reconstruction,
    options: MapperOptions,
    limits: pycolmap.IncrementalMapperOptions,
    priors: PositionPriors | None,
) -> FinishedModel:
    """The model after its last adjustments, held to its positions where it has enough, without
    photos whose cameras have left the ``limits``; the one given may change as well."""
    polished = final_adjustment(reconstruction, options.robust, options.calibration)
    finished, is_held = polished.reconstruction, None
    if priors is not None and priors.are_enough:
        held = held_to_positions(finished, priors, options.robust, options.priors)
        finished, is_held = held or finished, held is not None
    if not is_miscalibrated(finished, limits):
        for image_id in impossible_photos(finished, limits):
            finished.deregister_frame(finished.image(image_id).frame_id)
    return FinishedModel(finished, polished.focal_sigmas, is_held)
