"""The drift of a model, spread over the way from one end to the other.

A pose graph in three steps, each of them linear or nearly so, as L. Carlone et al., "Initialization
techniques for 3D SLAM", ICRA 2015, begin theirs: first how far each photo turns and scales, then
where it comes to stand.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import pycolmap

from sfm_front.types import Float64Array

# Of the conjugate gradients: relative to the start.
_TOLERANCE = 1e-6

Links = Mapping[tuple[int, int], float]
"""Two photos that hang together → how strongly they do."""


@dataclass(frozen=True)
class Correction:
    """How photos must move: those of ``moved`` by ``similarity``, those of ``fixed`` not at all."""

    similarity: pycolmap.Sim3d
    moved: Collection[int]
    fixed: Collection[int]


class Network:
    """Photos that hang together, some of which are held."""

    def __init__(self, links: Links, held: Collection[int]) -> None:
        self.image_ids = sorted({i for pair in links for i in pair})
        row = {image_id: number for number, image_id in enumerate(self.image_ids)}
        self.ends = np.array([(row[i], row[j]) for i, j in links], np.int64).reshape(-1, 2)
        self._strengths = np.array(list(links.values()), np.float64)
        self._free = np.array([image_id not in held for image_id in self.image_ids])

    def relax(self, values: Float64Array, differences: Float64Array) -> Float64Array:
        """(N, D) of each photo, such that they differ along the links (E, 2) by ``differences``
        (E, D) as well as can be; those of held photos stay. By conjugate gradients."""
        residual = -self._tension(values, differences)
        direction, size = residual, float((residual**2).sum())
        enough = _TOLERANCE**2 * size
        for _ in range(10 * len(values)):
            if size <= enough:
                break
            pull = self._tension(direction, np.zeros_like(differences))
            step = size / float((direction * pull).sum())
            values = values + step * direction
            residual = residual - step * pull
            size, before = float((residual**2).sum()), size
            direction = residual + size / before * direction
        return values

    def _tension(self, values: Float64Array, differences: Float64Array) -> Float64Array:
        """(N, D): what the links pull at each free photo."""
        first, second = self.ends.T
        pulls = self._strengths[:, None] * (values[second] - values[first] - differences)
        tension = np.column_stack(
            [
                np.bincount(second, pull, len(values)) - np.bincount(first, pull, len(values))
                for pull in pulls.T
            ]
        )
        return np.where(self._free[:, None], tension, 0.0)


def corrections(
    model: pycolmap.Reconstruction, links: Links, correction: Correction
) -> dict[int, tuple[float, pycolmap.Sim3d]]:
    """Image id → the share of the correction's turn and scale that a photo takes, and how it moves.

    From photo to photo the shares change as little as can be, least where the links are strong, and
    photos stand to each other as they did, but for these turns and scales. What hangs together with
    neither end stays.
    """
    network = Network(links, {*correction.moved, *correction.fixed})
    image_ids, ends = network.image_ids, network.ends
    start = np.array([[float(i in correction.moved)] for i in image_ids])
    shares = network.relax(start, np.zeros((len(ends), 1)))[:, 0]
    similarity = correction.similarity
    turn = np.asarray(cv2.Rodrigues(similarity.rotation.matrix())[0], np.float64)
    centers = np.array([model.image(i).projection_center() for i in image_ids])
    baselines = centers[ends[:, 1]] - centers[ends[:, 0]]
    halfway: Float64Array = shares[ends].mean(axis=1)
    turned = np.einsum("nij,nj->ni", _rotations(halfway, turn), baselines)
    scales = similarity.scale**shares
    moved = np.where(start > 0, np.asarray(similarity * centers), centers)
    places = network.relax(moved, similarity.scale ** halfway[:, None] * turned)
    return {
        image_id: (float(share), _moving(scale, rotation, center, place))
        for image_id, share, scale, rotation, center, place in zip(
            image_ids, shares, scales, _rotations(shares, turn), centers, places, strict=True
        )
    }


def move(model: pycolmap.Reconstruction, moves: Mapping[int, pycolmap.Sim3d]) -> None:
    """Move photos, and each point to the mean of where its photos take it."""
    for image_id in moves:
        image = model.image(image_id)
        moved = moves[image_id].transform_camera_world(image.cam_from_world())
        model.frame(image.frame_id).rig_from_world = moved  # a frame's only image is its camera
    for point_id in model.point3D_ids():
        point = model.point3D(point_id)
        by = [moves[e.image_id] for e in point.track.elements if e.image_id in moves]
        if by:
            point.xyz = np.mean([similarity * point.xyz for similarity in by], axis=0)


def _rotations(shares: Float64Array, turn: Float64Array) -> Float64Array:
    """(N, 3, 3) of shares (N,) of a rotation vector (3, 1)."""
    return np.array([cv2.Rodrigues(share * turn)[0] for share in shares]).reshape(-1, 3, 3)


def _moving(
    scale: float, rotation: Float64Array, center: Float64Array, place: Float64Array
) -> pycolmap.Sim3d:
    """Turned and scaled round ``center`` (3,), which comes to lie at ``place`` (3,)."""
    shift = place - scale * rotation @ center
    return pycolmap.Sim3d(float(scale), pycolmap.Rotation3d(rotation), shift)
