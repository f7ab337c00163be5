"""Where marks in photos meet in space, and which of them do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.types import Float64Array

# Between two rays: nearer to parallel they do not say how far the point is.
_MIN_ANGLE_DEG = 1.0
_ITERATIONS = 20
# Of the distance from the cameras, to take derivatives by.
_STEP = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A mark (2,) in pixels in a registered image."""

    image: pycolmap.Image
    xy: Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class MarkedPlace:
    """A triangulated point.

    ``xyz`` (3,) in the model; ``residuals_px`` (N, 2): mark minus projection, nan behind a camera;
    ``agree`` (N,): marks that it rests on, at least two; ``covariance`` (3, 3) if these have a
    standard deviation of one pixel.
    """

    xyz: Float64Array
    residuals_px: Float64Array
    agree: NDArray[np.bool_]
    covariance: Float64Array


def triangulate(sightings: Sequence[Sighting], max_error_px: float) -> MarkedPlace | None:
    """The place that most marks agree on, to ``max_error_px``; None if no two do.

    Every two rays make a hypothesis, which is scored by MSAC (P. Torr & A. Zisserman, "MLESAC",
    CVIU 2000); the best one is refined on the reprojection errors of the marks that agree.
    """
    rays = [_ray(sighting) for sighting in sightings]
    best, best_score = None, 0.0
    for first, second in combinations(rays, 2):
        xyz = _meeting(first, second)
        if xyz is None:
            continue
        squares = _squares(_residuals(sightings, xyz))
        score = float(np.maximum(1 - squares / max_error_px**2, 0).sum())
        if score > best_score:
            best, best_score = xyz, score
    if best is None:
        return None
    agree = _squares(_residuals(sightings, best)) < max_error_px**2
    for _ in range(_ITERATIONS):
        if agree.sum() < 2:
            return None
        chosen = [s for s, is_good in zip(sightings, agree, strict=True) if is_good]
        best, covariance = _refined(chosen, best)
        residuals = _residuals(sightings, best)
        before, agree = agree, _squares(residuals) < max_error_px**2
        if (agree == before).all():
            return MarkedPlace(best, residuals, agree, covariance)
    return None


def _ray(sighting: Sighting) -> tuple[Float64Array, Float64Array] | None:
    """Camera centre and direction of length 1."""
    camera = sighting.image.camera
    on_plane = None if camera is None else camera.cam_from_img(sighting.xy)
    if on_plane is None:
        return None
    rotation = sighting.image.cam_from_world().rotation.matrix()
    direction = np.append(on_plane, 1.0) @ rotation
    return sighting.image.projection_center(), direction / np.linalg.norm(direction)


def _meeting(
    first: tuple[Float64Array, Float64Array] | None,
    second: tuple[Float64Array, Float64Array] | None,
) -> Float64Array | None:
    """The middle between two rays where they are nearest; None behind a camera or if parallel."""
    if first is None or second is None:
        return None
    (centre1, direction1), (centre2, direction2) = first, second
    cosine = float(direction1 @ direction2)
    if cosine > np.cos(np.radians(_MIN_ANGLE_DEG)):
        return None
    sides = np.stack([direction1, -direction2], axis=1)
    (far1, far2), *_ = np.linalg.lstsq(sides, centre2 - centre1, rcond=None)
    if far1 <= 0 or far2 <= 0:
        return None
    middle: Float64Array = (centre1 + far1 * direction1 + centre2 + far2 * direction2) / 2
    return middle


def _residuals(sightings: Sequence[Sighting], xyz: Float64Array) -> Float64Array:
    """(N, 2) mark minus projection, nan behind the camera."""
    projected = [sighting.image.project_point(xyz) for sighting in sightings]
    nowhere = np.full(2, np.nan)
    return np.array(
        [s.xy - (nowhere if p is None else p) for s, p in zip(sightings, projected, strict=True)]
    )


def _squares(residuals: Float64Array) -> Float64Array:
    squares: Float64Array = np.nan_to_num((residuals**2).sum(axis=1), nan=np.inf)
    return squares


def _refined(sightings: Sequence[Sighting], xyz: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Gauss-Newton on the reprojection errors: the place and its covariance for 1 px."""
    distance = np.mean([np.linalg.norm(xyz - s.image.projection_center()) for s in sightings])
    step = _STEP * float(distance)
    for _ in range(_ITERATIONS):
        residuals = _residuals(sightings, xyz).ravel()
        jacobian = np.stack(
            [
                (_residuals(sightings, xyz - change) - _residuals(sightings, xyz + change)).ravel()
                for change in step * np.eye(3)
            ],
            axis=1,
        ) / (2 * step)
        if not (np.isfinite(residuals).all() and np.isfinite(jacobian).all()):
            break
        change, *_ = np.linalg.lstsq(jacobian, residuals, rcond=None)
        xyz = xyz + change
        if np.linalg.norm(change) < step:
            break
    return xyz, np.linalg.pinv(jacobian.T @ jacobian)
