"""The drift of a model, spread over the way from one end to the other."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import cv2
import numpy as np
import pycolmap

from sfm_front.types import Float64Array

# Of the conjugate gradients: relative to the start.
_TOLERANCE = 1e-6

Weights = Mapping[tuple[int, int], float]
"""Two photos that hang together → how much they do."""


def spread(links: Weights, moved: Collection[int], fixed: Collection[int]) -> dict[int, float]:
    """What share of a correction each photo takes: 1 where ``moved``, 0 where ``fixed``.

    Between them shares change as little as can be from photo to photo, and least where ``links``
    are strong: heat flows so through a network. Photos that hang together with neither take none.
    """
    image_ids = sorted({i for pair in links for i in pair})
    number = {image_id: row for row, image_id in enumerate(image_ids)}
    ends = np.array([[number[i], number[j]] for i, j in links]).reshape(-1, 2)
    strengths = np.array(list(links.values()), np.float64)
    shares = np.array([float(i in moved) for i in image_ids])
    free = np.array([i not in moved and i not in fixed for i in image_ids])

    def flow(values: Float64Array) -> Float64Array:
        through = strengths * (values[ends[:, 0]] - values[ends[:, 1]])
        out = np.bincount(ends[:, 0], through, len(values))
        out -= np.bincount(ends[:, 1], through, len(values))
        return np.where(free, out, 0.0)

    # Conjugate gradients: nothing flows in or out of a free photo.
    residual = -flow(shares)
    direction, size = residual, float(residual @ residual)
    enough = _TOLERANCE**2 * size
    for _ in range(10 * len(image_ids)):
        if size <= enough:
            break
        flown = flow(direction)
        step = size / float(direction @ flown)
        shares = shares + step * direction
        residual = residual - step * flown
        size, before = float(residual @ residual), size
        direction = residual + size / before * direction
    return dict(zip(image_ids, shares.tolist(), strict=True))


def move_photos(
    model: pycolmap.Reconstruction,
    correction: pycolmap.Sim3d,
    center: Float64Array,
    shares: Mapping[int, float],
) -> None:
    """Move each photo by its share of a correction, and each point by the mean of its photos.

    A share of a similarity turns and scales round ``center`` (3,), and shifts it, by that share.
    """
    for image_id in model.reg_image_ids():
        image = model.image(image_id)
        part = _part(correction, center, shares.get(image_id, 0.0))
        moved = part.transform_camera_world(image.cam_from_world())
        model.frame(image.frame_id).rig_from_world = moved  # a frame's only image is its camera
    for point_id in model.point3D_ids():
        point = model.point3D(point_id)
        seen_by = [shares.get(e.image_id, 0.0) for e in point.track.elements]
        point.xyz = _part(correction, center, sum(seen_by) / len(seen_by)) * point.xyz


def _part(correction: pycolmap.Sim3d, center: Float64Array, share: float) -> pycolmap.Sim3d:
    turn, _ = cv2.Rodrigues(correction.rotation.matrix())
    rotation = pycolmap.Rotation3d(share * turn[:, 0])
    scale = float(correction.scale) ** share
    moved = center + share * (correction * center - center)
    return pycolmap.Sim3d(scale, rotation, moved - scale * (rotation * center))
