"""Photos as another camera would have taken them from the same place: undistorted, reduced."""

from __future__ import annotations

import copy
import math
from enum import Enum

import cv2
import numpy as np
import pycolmap

from sfm_front.errors import InputError
from sfm_front.photos.decoding import Undecodable, decode
from sfm_front.types import Float32Array, Float64Array, Uint8Array

_ROWS_AT_ONCE = 64
# Of a principal point: far below what anybody can see, far above rounding.
_SAME_PX = 1e-6
_NOWHERE = -9.0


class Projection(Enum):
    """What a target can hold: cameras ``AS_TAKEN``, with their distortion; ``PINHOLE`` alone; or a
    ``CENTRED_PINHOLE``, whose principal point is the middle of the photo."""

    AS_TAKEN = "as taken"
    PINHOLE = "pinhole"
    CENTRED_PINHOLE = "centred pinhole"


def target_camera(
    camera: pycolmap.Camera, projection: Projection, max_size_px: int | None
) -> pycolmap.Camera:
    """The camera that photos of ``camera`` are made for; it keeps the id.

    Undistorted as ``pycolmap.undistort_camera`` does: the same focal lengths, no blank pixels.
    Cropped on the far side where the principal point has to be the middle. Raises InputError for
    cameras that no pinhole can stand for.
    """
    target = copy.copy(camera)
    if projection is not Projection.AS_TAKEN:
        target = _pinhole(camera)
    if projection is Projection.CENTRED_PINHOLE:
        _crop_to_centre(target)
    larger = max(target.width, target.height)
    if max_size_px is not None and larger > max_size_px:
        scale = max_size_px / larger
        target.rescale(max(1, round(target.width * scale)), max(1, round(target.height * scale)))
    target.camera_id = camera.camera_id
    return target


def takes_same_photos(camera: pycolmap.Camera, other: pycolmap.Camera) -> bool:
    """Whether photos of the one are photos of the other, pixel for pixel."""
    if (camera.width, camera.height) != (other.width, other.height):
        return False
    if camera.model == other.model:
        return bool(np.array_equal(camera.params, other.params))
    return camera.is_undistorted() and np.allclose(
        camera.calibration_matrix(), other.calibration_matrix(), rtol=0, atol=_SAME_PX
    )


def moved_points(
    points: Float64Array, camera: pycolmap.Camera, target: pycolmap.Camera
) -> Float64Array:
    """(N, 2) pixels of a photo of ``camera`` → the same directions in one of ``target``.

    nan where ``camera`` has no direction for a pixel.
    """
    if not len(points):
        return points
    directions = np.asarray(camera.cam_from_img(np.ascontiguousarray(points, np.float64)))
    rays = np.column_stack([directions, np.ones(len(directions))])
    return np.asarray(target.img_from_cam(rays), np.float64)


def source_pixels(camera: pycolmap.Camera, target: pycolmap.Camera) -> Float32Array:
    """Where each pixel of a photo of ``target`` lies in one of ``camera``.

    (target height, target width, 2) x, y as a fraction of width and height, so that it holds for
    photos that were decoded smaller; 0 is the outer edge of the first pixel. Outside of it where
    ``camera`` does not see.
    """
    fractions = np.empty((target.height, target.width, 2), np.float32)
    size = np.array([camera.width, camera.height], np.float64)
    for top in range(0, target.height, _ROWS_AT_ONCE):
        bottom = min(top + _ROWS_AT_ONCE, target.height)
        x, y = np.meshgrid(np.arange(target.width) + 0.5, np.arange(top, bottom) + 0.5)
        there = moved_points(np.column_stack([x.ravel(), y.ravel()]), target, camera)
        seen = np.nan_to_num(there / size, nan=_NOWHERE)
        fractions[top:bottom] = seen.reshape(bottom - top, target.width, 2)
    return fractions


def decoded(
    data: bytes, camera: pycolmap.Camera, target: pycolmap.Camera
) -> Uint8Array | Undecodable | tuple[int, int]:
    """(h, w, 3) RGB of a photo of ``camera``, no larger than ``target`` can show.

    Else why the bytes are no photo, or the width and height of one of another size.
    """
    scale = min(1.0, float(target.mean_focal_length() / camera.mean_focal_length()))
    photo = decode(data, math.ceil(max(camera.width, camera.height) * scale))
    if isinstance(photo, Undecodable):
        return photo
    size = photo.width, photo.height
    return photo.pixels if size == (camera.width, camera.height) else size


def resampled(pixels: Uint8Array, fractions: Float32Array) -> Uint8Array:
    """The photo whose pixels lie at ``source_pixels``; black where there is nothing."""
    height, width = pixels.shape[:2]
    places = fractions * np.array([width, height], np.float32) - np.float32(0.5)
    # OpenCV's stubs do not know that one map may hold both coordinates.
    remapped = cv2.remap(pixels, places, None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
    return np.asarray(remapped, dtype=np.uint8)


def _pinhole(camera: pycolmap.Camera) -> pycolmap.Camera:
    # First: pycolmap 4.2 crashes when a panorama is asked for its focal length.
    if not camera.is_perspective():
        raise InputError(
            f"camera {camera.camera_id}: {camera.model_name} cannot be undistorted to a pinhole "
            "camera, which this target needs; --to colmap-text, ply or csv does without"
        )
    if camera.is_undistorted():
        return pycolmap.Camera(
            model="PINHOLE",
            width=camera.width,
            height=camera.height,
            params=[
                camera.focal_length_x,
                camera.focal_length_y,
                camera.principal_point_x,
                camera.principal_point_y,
            ],
        )
    return pycolmap.undistort_camera(pycolmap.UndistortCameraOptions(), camera)


def _crop_to_centre(camera: pycolmap.Camera) -> None:
    """Make the principal point the middle of what is left; the focal lengths stay."""
    x, y = camera.principal_point_x, camera.principal_point_y
    width = int(2 * min(x, camera.width - x) + _SAME_PX)
    height = int(2 * min(y, camera.height - y) + _SAME_PX)
    if width < 1 or height < 1:
        raise InputError(
            f"camera {camera.camera_id}: its principal point lies outside the photo, which this "
            "target cannot hold; try --to gsplat or nerfstudio"
        )
    camera.width, camera.height = width, height
    camera.params = [camera.focal_length_x, camera.focal_length_y, width / 2, height / 2]
