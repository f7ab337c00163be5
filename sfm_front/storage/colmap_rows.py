"""Rows of COLMAP's database for a photo and its pairs, as pycolmap writes them.

pycolmap's own transaction commits when its block raises, and its writes abort the process when the
disk is full. Rows that we write can be part of a transaction that holds all of a photo or nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.storage.sqlite_file import Row
from sfm_front.types import ExtractedPhoto, GeoPosition, PairGeometry, Uint32Array

_CAMERA = int(pycolmap.SensorType.CAMERA)
_UNKNOWN_COVARIANCE = np.full((3, 3), np.nan)
_UNKNOWN_GRAVITY = np.full(3, np.nan)


def camera_rows(camera: pycolmap.Camera) -> Iterator[Row]:
    """The camera and the trivial rig that has its id."""
    yield Row(
        "cameras",
        {
            "camera_id": camera.camera_id,
            "model": int(camera.model),
            "width": camera.width,
            "height": camera.height,
            "params": _blob(camera.params, np.float64),
            "prior_focal_length": int(camera.has_prior_focal_length),
        },
        once=True,
    )
    yield Row(
        "rigs",
        {
            "rig_id": camera.camera_id,
            "ref_sensor_id": camera.camera_id,
            "ref_sensor_type": _CAMERA,
        },
        once=True,
    )


def photo_rows(image_id: int, photo: ExtractedPhoto, camera_id: int) -> Iterator[Row]:
    """The image, the frame that has its id, and its features."""
    yield Row("images", {"image_id": image_id, "name": photo.name, "camera_id": camera_id})
    yield Row("frames", {"frame_id": image_id, "rig_id": camera_id})
    yield Row(
        "frame_data",
        {
            "frame_id": image_id,
            "data_id": image_id,
            "sensor_id": camera_id,
            "sensor_type": _CAMERA,
        },
    )
    keypoints = photo.features.keypoints
    yield Row("keypoints", {"image_id": image_id, **_matrix(keypoints, np.float32)})
    yield Row(
        "descriptors",
        {
            "image_id": image_id,
            "type": int(pycolmap.FeatureExtractorType.SIFT),
            **_matrix(photo.features.descriptors, np.uint8),
        },
    )


def inlier_data(image_id1: int, image_id2: int, matches: Uint32Array) -> bytes:
    """Inliers (M, 2) of a pair as ``pair_rows`` writes them, the photo of lower id first."""
    ordered = matches if image_id1 < image_id2 else matches[:, ::-1]
    return _blob(ordered, np.uint32)


def pair_rows(pair: PairGeometry) -> Iterator[Row]:
    """Tentative matches and two-view geometry, the photo of lower id first."""
    matches, geometry = pair.matches, pair.two_view_geometry
    inliers = geometry.inlier_matches
    if pair.image_id1 > pair.image_id2:
        matches, inliers = matches[:, ::-1], inliers[:, ::-1]
        geometry = _inverted(geometry)
    pair_id = pycolmap.image_pair_to_pair_id(pair.image_id1, pair.image_id2)
    yield Row("matches", {"pair_id": pair_id, **_matrix(matches, np.uint32)})
    pose = geometry.cam2_from_cam1
    yield Row(
        "two_view_geometries",
        {
            "pair_id": pair_id,
            **_matrix(inliers, np.uint32),
            "config": int(geometry.config),
            **{name: _optional(getattr(geometry, name)) for name in ("F", "E", "H")},
            "qvec": None if pose is None else _blob(np.roll(pose.rotation.quat, 1), np.float64),
            "tvec": None if pose is None else _blob(pose.translation, np.float64),
        },
    )


PAIR_COLUMNS = (
    "m.rows, m.data, g.rows, g.data, g.config, g.F, g.E, g.H, g.qvec, g.tvec "
    "FROM matches m JOIN two_view_geometries g USING (pair_id)"
)
"""What ``read_pair`` takes, and the tables it comes from."""


def read_pair(
    image_id1: int, image_id2: int, row: tuple[Any, ...], tri_angle: float
) -> PairGeometry:
    """The pair of a row of ``PAIR_COLUMNS``; COLMAP's tables have no place for the angle."""
    matches, inliers = (
        np.frombuffer(data or b"", np.uint32).reshape(rows, 2) for rows, data in (row[:2], row[2:4])
    )
    geometry = pycolmap.TwoViewGeometry()
    geometry.config = row[4]
    geometry.F, geometry.E, geometry.H = (
        None if blob is None else np.frombuffer(blob, np.float64).reshape(3, 3) for blob in row[5:8]
    )
    if row[8] is not None:
        w, x, y, z = np.frombuffer(row[8], np.float64)
        rotation = pycolmap.Rotation3d(np.array((x, y, z, w)))
        geometry.cam2_from_cam1 = pycolmap.Rigid3d(rotation, np.frombuffer(row[9], np.float64))
    if image_id1 > image_id2:
        geometry.invert()
        matches, inliers = matches[:, ::-1], inliers[:, ::-1]
    geometry.inlier_matches = np.ascontiguousarray(inliers)
    geometry.tri_angle = tri_angle
    return PairGeometry(image_id1, image_id2, np.ascontiguousarray(matches), geometry)


CAMERA_COLUMNS = "camera_id, model, width, height, params, prior_focal_length FROM cameras"
"""What ``read_camera`` takes, and its table."""


def read_camera(row: tuple[Any, ...]) -> pycolmap.Camera:
    """The camera of a row of ``CAMERA_COLUMNS``."""
    camera_id, model, width, height, params, has_prior = row
    camera = pycolmap.Camera(
        camera_id=camera_id,
        model=pycolmap.CameraModelId(model),
        width=width,
        height=height,
        params=np.frombuffer(params, np.float64),
    )
    camera.has_prior_focal_length = bool(has_prior)
    return camera


def _inverted(geometry: pycolmap.TwoViewGeometry) -> pycolmap.TwoViewGeometry:
    swapped = pycolmap.TwoViewGeometry()
    swapped.config = geometry.config
    swapped.F, swapped.E, swapped.H = geometry.F, geometry.E, geometry.H
    swapped.cam2_from_cam1 = geometry.cam2_from_cam1
    swapped.invert()
    return swapped


def prior_rows(image_id: int, camera_id: int, position: GeoPosition) -> Iterator[Row]:
    """COLMAP's WGS84 prior: latitude and longitude in degrees, altitude in metres, and covariance
    in metres of east, north and up: COLMAP turns the position into such a frame, and leaves the
    covariance as it is. It is unknown where a standard deviation is.

    A position without altitude has none, nor one without a fix: COLMAP turns all priors into NaN
    if the first has no altitude, and puts its frame where the first is.
    """
    if position.altitude_m is None or not position.is_fix:
        return
    horizontal, vertical = position.horizontal_sigma_m, position.vertical_sigma_m
    if horizontal is None or vertical is None:
        covariance = _UNKNOWN_COVARIANCE
    else:
        covariance = np.diag(np.square((horizontal, horizontal, vertical)))
    yield Row(
        "pose_priors",
        {
            "corr_data_id": image_id,
            "corr_sensor_id": camera_id,
            "corr_sensor_type": _CAMERA,
            "position": _blob(
                (position.latitude_deg, position.longitude_deg, position.altitude_m), np.float64
            ),
            "position_covariance": _blob(covariance, np.float64),
            "gravity": _blob(_UNKNOWN_GRAVITY, np.float64),
            "coordinate_system": int(pycolmap.PosePriorCoordinateSystem.WGS84),
        },
    )


def _matrix(values: NDArray[Any] | Uint32Array, dtype: type[np.generic]) -> dict[str, Any]:
    rows, cols = values.shape
    return {"rows": rows, "cols": cols, "data": _blob(values, dtype)}


def _optional(matrix: NDArray[Any] | None) -> bytes | None:
    return None if matrix is None else _blob(matrix, np.float64)


def _blob(values: Any, dtype: type[np.generic]) -> bytes:
    """Row by row."""
    return np.ascontiguousarray(values, dtype).tobytes()
