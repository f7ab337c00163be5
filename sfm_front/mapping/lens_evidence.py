"""What the residuals of an adjusted model say of a camera's lens: what else would explain them."""

from __future__ import annotations

import copy
from collections.abc import Collection
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import pycolmap

from sfm_front.geometry.lenses import as_opencv
from sfm_front.mapping.observation_sample import ObservationSample
from sfm_front.types import Float64Array

# Rows of equations that are held at once.
_ROWS = 4000
# Half-widths for derivatives: of a parameter in units of 1 or of the focal length, of a point in
# those of its depth.
_STEP = 1e-6
# From so many times the median residual the robust weight falls off.
_WEIGHT_SCALE = 2.0
# Equations left over for each unknown; with fewer residuals say nothing.
_MIN_REDUNDANCY = 2.0


class Param(IntEnum):
    """What may be wrong with a lens: directions among the parameters of OPENCV's model."""

    FOCAL = 0
    ASPECT = 1
    CX = 2
    CY = 3
    K1 = 4
    K2 = 5
    P1 = 6
    P2 = 7


@dataclass(frozen=True, eq=False)
class LensEvidence:
    """One step of Gauss and Newton, with poses and points eliminated (Schur's complement).

    ``information`` (P, P) and ``gradient`` (P,) by ``Param``, in pixels; ``cost``: the weighted sum
    of squared residuals, ``redundancy``: equations less unknowns. ``share``: of the points used.
    """

    information: Float64Array
    gradient: Float64Array
    cost: float
    redundancy: int
    share: float
    focal_px: float

    @classmethod
    def of(cls, reconstruction: pycolmap.Reconstruction, camera_id: int) -> LensEvidence | None:
        """Of a camera in an adjusted model; None for fisheyes and where there are too few points.

        The equations are those of a sample, so that they take a fraction of a second however large
        the model is. Residuals are weighted by the median: an adjustment's loss of a pixel or so
        weighs wrong matches as much as those that are exact to a quarter of it.
        """
        camera = as_opencv(reconstruction.camera(camera_id))
        if camera is None:
            return None
        sample = ObservationSample.of(reconstruction, camera_id)
        num_rows, num_photos = 2 * len(sample.pixels), len(sample.rotations)
        redundancy = num_rows - 3 * len(sample.points) - 6 * num_photos
        if num_photos < 2 or redundancy < _MIN_REDUNDANCY * (6 * num_photos + len(Param)):
            return None
        equations = _weighted(camera, sample)
        if equations is None:
            return None
        reduced = _without_poses(_without_points(*equations, sample), sample)
        return cls(
            reduced[:-1, :-1],
            reduced[:-1, -1],
            float(reduced[-1, -1]),
            redundancy,
            sample.share,
            float(camera.mean_focal_length()),
        )

    def explained(self, params: Collection[Param]) -> float:
        """Share of the cost that goes if these move, along with poses and points."""
        step = self._inverse(params) @ self.gradient[list(params)]
        return float(np.clip(self.gradient[list(params)] @ step / self.cost, 0.0, 1.0))

    def focal_sigma(self, params: Collection[Param]) -> float:
        """Standard deviation of the focal length, as a share of it, once these have moved.

        ``params`` begin with the focal length. By the residuals that are left: no lens of another
        kind, no wrong match that many points share is in it.
        """
        left = self.cost * (1 - self.explained(params))
        variance = self._inverse(params)[0, 0] * left / self.redundancy * self.share
        return float(np.sqrt(max(variance, 0.0))) / self.focal_px

    def _inverse(self, params: Collection[Param]) -> Float64Array:
        chosen = self.information[np.ix_(list(params), list(params))]
        scale = 1 / np.sqrt(np.maximum(np.diag(chosen), np.finfo(float).tiny))
        scaled = chosen * scale[:, None] * scale
        inverse = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
        return np.asarray(inverse * scale[:, None] * scale, np.float64)


_Equations = tuple[Float64Array, Float64Array, Float64Array]


def _weighted(camera: pycolmap.Camera, sample: ObservationSample) -> _Equations | None:
    """Derivatives by pose (K, 2, 6), point (K, 2, 3), and lens (K, 2, P + 1), whose last column
    holds the residuals; None where a point is not in front of a photo."""
    rotations = sample.rotations[sample.photo]
    seen = np.einsum("kij,kj->ki", rotations, sample.points[sample.point])
    seen += sample.translations[sample.photo]
    residuals = sample.pixels - np.asarray(camera.img_from_cam(seen))
    if np.any(seen[:, 2] <= 0) or not np.all(np.isfinite(residuals)):
        return None
    squared = (residuals**2).sum(axis=1)
    scale = _WEIGHT_SCALE**2 * max(float(np.median(squared)), np.finfo(float).tiny)
    weights = np.sqrt(1 / (1 + squared / scale))[:, None, None]
    by_seen = _by_point(camera, seen)
    x, y, z = seen.T
    none = np.zeros(len(seen))
    turned = np.array([[none, z, -y], [-z, none, x], [y, -x, none]]).transpose(2, 0, 1)
    by_pose = np.concatenate([by_seen @ turned, by_seen], axis=2)
    by_lens = np.concatenate([_by_params(camera, seen), residuals[:, :, None]], axis=2)
    return weights * by_pose, weights * (by_seen @ rotations), weights * by_lens


def _by_point(camera: pycolmap.Camera, seen: Float64Array) -> Float64Array:
    """(K, 2, 3) derivatives of pixels by points (K, 3) in the camera."""
    step = _STEP * seen[:, 2:]
    columns = [
        (
            np.asarray(camera.img_from_cam(seen + step * axis))
            - np.asarray(camera.img_from_cam(seen - step * axis))
        )
        / (2 * step)
        for axis in np.eye(3)
    ]
    return np.stack(columns, axis=2)


def _by_params(camera: pycolmap.Camera, seen: Float64Array) -> Float64Array:
    """(K, 2, P) derivatives of pixels by the parameters of a lens."""
    columns = []
    for param in Param:
        direction = np.zeros(len(Param))
        direction[[0, 1] if param is Param.FOCAL else [0] if param is Param.ASPECT else [param]] = 1
        step = _STEP * (camera.mean_focal_length() if param < Param.K1 else 1.0)
        there, back = copy.copy(camera), copy.copy(camera)
        there.params = (camera.params + step * direction).tolist()
        back.params = (camera.params - step * direction).tolist()
        moved = np.asarray(there.img_from_cam(seen)) - np.asarray(back.img_from_cam(seen))
        columns.append(moved / (2 * step))
    return np.stack(columns, axis=2)


def _without_points(
    by_pose: Float64Array, by_point: Float64Array, by_lens: Float64Array, sample: ObservationSample
) -> Float64Array:
    """(6 M + P + 1)² normal equations of poses and lens with the points eliminated.

    By projection on what is orthogonal to a point's columns, not by subtracting normal equations:
    these lose all digits where rays are nearly parallel.
    """
    num_poses = 6 * len(sample.rotations)
    size = num_poses + by_lens.shape[2]
    observers = np.bincount(sample.point, minlength=len(sample.points))
    order, end = np.argsort(sample.point, kind="stable"), np.cumsum(observers)
    normal = np.zeros((size, size))
    for length in np.unique(observers).tolist():
        points = np.flatnonzero(observers == length)
        for some in np.array_split(points, -(-2 * length * len(points) // _ROWS)):
            rows = order[(end[some] - length)[:, None] + np.arange(length)]
            equations = np.zeros((len(some), length, 2, size))
            point, place = np.indices(rows.shape)
            for column in range(6):
                target = 6 * sample.photo[rows] + column
                equations[point, place, :, target] = by_pose[rows, :, column]
            equations[..., num_poses:] = by_lens[rows]
            equations = equations.reshape(len(some), 2 * length, size)
            basis, _ = np.linalg.qr(by_point[rows].reshape(len(some), 2 * length, 3))
            equations -= basis @ (basis.transpose(0, 2, 1) @ equations)
            equations = equations.reshape(-1, size)
            normal += equations.T @ equations
    return normal


def _without_poses(normal: Float64Array, sample: ObservationSample) -> Float64Array:
    """(P + 1)² normal equations of the lens. Seven numbers of two poses are held: no photo tells
    where the world is, and how large."""
    num_poses = 6 * len(sample.rotations)
    centers = -np.einsum("mji,mj->mi", sample.rotations, sample.translations)
    away = np.einsum("mij,mj->mi", sample.rotations, centers - centers[0])
    far, axis = np.unravel_index(int(np.argmax(np.abs(away))), away.shape)
    free = np.ones(num_poses, np.bool_)
    free[:6] = False
    free[6 * far + 3 + axis] = False
    kept = np.flatnonzero(free)
    poses, both = normal[np.ix_(kept, kept)], normal[kept, num_poses:]
    scale = 1 / np.sqrt(np.maximum(np.diag(poses), np.finfo(float).tiny))
    inverse = np.linalg.pinv(poses * scale[:, None] * scale, rcond=1e-13, hermitian=True)
    scaled = scale[:, None] * both
    reduced: Float64Array = normal[num_poses:, num_poses:] - scaled.T @ inverse @ scaled
    return reduced
