"""Pose of a photo in a model, by 2D-3D matches from its first verified pairs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.types import Float32Array, Float64Array, PairGeometry, Uint32Array


@dataclass(frozen=True, kw_only=True)
class LocalizationOptions:
    """When a pose is accepted."""

    # Reprojection error of an inlier, in pixels of the file.
    max_error_px: float = 8.0
    # Number and share of the points that a pose must fit.
    min_inliers: int = 30
    min_share: float = 0.5
    # Points used per pair.
    sample: int = 100
    # Of the sample and of RANSAC.
    seed: int = 0

    def __post_init__(self) -> None:
        if self.max_error_px <= 0:
            raise ConfigError(f"max_error_px must be above 0, got {self.max_error_px}")
        if self.min_inliers < 4:
            raise ConfigError(f"min_inliers must be at least 4, got {self.min_inliers}")
        if not 0 <= self.min_share <= 1:
            raise ConfigError(f"min_share must be from 0 to 1, got {self.min_share}")
        if self.sample < 1:
            raise ConfigError(f"sample must be at least 1, got {self.sample}")


def registered_photo(reconstruction: pycolmap.Reconstruction, image_id: int) -> PosedCamera | None:
    """Camera and pose of a photo in a model; None if it is not registered."""
    image = _registered_image(reconstruction, image_id)
    if image is None:
        return None
    return PosedCamera(reconstruction.camera(image.camera_id), image.cam_from_world())


def _registered_image(
    reconstruction: pycolmap.Reconstruction, image_id: int
) -> pycolmap.Image | None:
    if not reconstruction.exists_image(image_id):
        return None
    image = reconstruction.image(image_id)
    return image if image.has_pose else None


def locate(
    reconstruction: pycolmap.Reconstruction,
    camera_id: int,
    keypoints: Float32Array,
    pairs: Iterable[PairGeometry],
    options: LocalizationOptions,
) -> PosedCamera | None:
    """Pose of a photo with keypoints (N, 4) by its pairs with photos of a model.

    The camera is the model's. None if the model lacks it, or too few points fit a pose.
    """
    if not reconstruction.exists_camera(camera_id):
        return None
    xy, xyz = _seen(reconstruction, keypoints, pairs, options)
    if len(xy) < options.min_inliers:
        return None
    estimation = pycolmap.AbsolutePoseEstimationOptions()
    estimation.ransac.max_error = options.max_error_px
    estimation.ransac.random_seed = options.seed
    camera = reconstruction.camera(camera_id)
    found = pycolmap.estimate_and_refine_absolute_pose(xy, xyz, camera, estimation)
    if found is None:
        return None
    if found["num_inliers"] < max(options.min_inliers, options.min_share * len(xy)):
        return None
    return PosedCamera(camera, found["cam_from_world"])


def _seen(
    reconstruction: pycolmap.Reconstruction,
    keypoints: Float32Array,
    pairs: Iterable[PairGeometry],
    options: LocalizationOptions,
) -> tuple[Float64Array, Float64Array]:
    """(K, 2) pixels of keypoints and (K, 3) matched model points in world coordinates."""
    point_of: dict[int, Float64Array] = {}
    for pair in pairs:
        image = _registered_image(reconstruction, pair.image_id2)
        if image is None:
            continue
        for index, other in _triangulated(pair, image, options).tolist():
            point_of[index] = reconstruction.point3D(image.point2D(other).point3D_id).xyz
    xy = keypoints[list(point_of), :2].astype(np.float64)
    return xy, np.array(list(point_of.values()), np.float64).reshape(-1, 3)


def _triangulated(
    pair: PairGeometry, image: pycolmap.Image, options: LocalizationOptions
) -> Uint32Array:
    """(K, 2) of the pair's inliers, a sample of those whose second keypoint has a 3-D point."""
    matches = pair.two_view_geometry.inlier_matches
    matches = matches[np.isin(matches[:, 1], image.get_observation_point2D_idxs())]
    if len(matches) <= options.sample:
        return matches
    rng = np.random.default_rng(options.seed)
    return matches[rng.choice(len(matches), options.sample, replace=False)]
