"""Bundle adjustment of a model that control points hold, and positions of its photos."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import pycolmap

from sfm_front.georeference.control.fixed_lookouts import Lookouts
from sfm_front.georeference.control.triangulation import Sighting
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions, robust_adjustment
from sfm_front.mapping.taking_over import take_over
from sfm_front.types import Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class HeldPoint:
    """``enu`` (3,) where it was surveyed, ``sigmas`` (3,) in metres, ``xyz`` (3,) where it is."""

    enu: Float64Array
    sigmas: Float64Array
    xyz: Float64Array
    sightings: Sequence[Sighting]


@dataclass(frozen=True, slots=True, eq=False)
class HeldCamera:
    """The photo ``image_id`` was measured to be at ``enu`` (3,), to ``sigmas`` (3,) in metres."""

    image_id: int
    enu: Float64Array
    sigmas: Float64Array


def adjust_with_control(
    reconstruction: pycolmap.Reconstruction,
    held: Sequence[HeldPoint],
    options: RobustAdjustmentOptions,
    pixel_sigma: float,
    cameras: Sequence[HeldCamera] = (),
) -> None:
    """Adjust a whole model in ENU, which these points hold: at least three, not on a line.

    ``pixel_sigma``: standard deviation of keypoints and marks, in pixels.

    What holds points and cameras (``Lookouts``) fixes the gauge as well. The first adjustment has
    plain squares, for a bent model is off by many standard deviations, which a robust loss would
    take for blunders.
    """
    model = copy.deepcopy(reconstruction)
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in model.reg_image_ids():
        config.add_image(image_id)
    lookouts = Lookouts(model, config, pixel_sigma)
    for point in held:
        track = pycolmap.Track()
        for sighting in point.sightings:
            image = model.image(sighting.image.image_id)
            image.points2D.append(pycolmap.Point2D(sighting.xy))
            track.add_element(image.image_id, len(image.points2D) - 1)
        lookouts.hold(track, point.enu, point.sigmas)
        model.add_point3D(point.xyz, track)
    for camera in cameras:
        track = pycolmap.Track()
        centre = model.image(camera.image_id).projection_center()
        lookouts.tie(track, camera.image_id)
        lookouts.hold(track, camera.enu, camera.sigmas)
        model.add_point3D(centre, track)
    for loss in (pycolmap.LossFunctionType.TRIVIAL, pycolmap.LossFunctionType.CAUCHY):
        adjustment = robust_adjustment(options, reconstruction.num_reg_images())
        adjustment.ceres.loss_function_type = loss
        pycolmap.create_default_bundle_adjuster(adjustment, config, model).solve()
    take_over(reconstruction, model)
    reconstruction.update_point_3d_errors()
