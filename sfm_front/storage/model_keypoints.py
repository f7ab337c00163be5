"""Keypoints of a binary COLMAP model that belong to points, as arrays.

pycolmap hands them out one by one, which takes half a minute where there are five million.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import InputError
from sfm_front.types import Float64Array

# Before an image's name: its id, quaternion, translation and camera's id.
_HEAD = struct.Struct("<I7dI")
_COUNT = struct.Struct("<Q")
_KEYPOINT = np.dtype([("xy", "<f8", 2), ("point3D_id", "<u8")])
# Of keypoints that belong to no point.
_NO_POINT = np.iinfo(np.uint64).max


@dataclass(frozen=True, slots=True, eq=False)
class PointKeypoints:
    """``xy`` (K, 2) in pixels of the file, and ``point_ids`` (K,)."""

    xy: Float64Array
    point_ids: NDArray[np.int64]


def read_point_keypoints(model: Path) -> dict[int, PointKeypoints]:
    """By image id. Raises InputError if the folder ``model`` has no whole ``images.bin``."""
    file = model / "images.bin"
    try:
        data = file.read_bytes()
        (count,), at = _COUNT.unpack_from(data), _COUNT.size
        found = {}
        for _ in range(count):
            image_id = _HEAD.unpack_from(data, at)[0]
            at = data.index(b"\0", at + _HEAD.size) + 1
            (size,), at = _COUNT.unpack_from(data, at), at + _COUNT.size
            keypoints = np.frombuffer(data, _KEYPOINT, size, at)
            at += keypoints.nbytes
            seen = keypoints[keypoints["point3D_id"] != _NO_POINT]
            found[image_id] = PointKeypoints(
                seen["xy"].astype(np.float64), seen["point3D_id"].astype(np.int64)
            )
    except (OSError, ValueError, struct.error) as error:
        raise InputError(f"{file}: cannot be read. Reconstruct again to write it.") from error
    return found
