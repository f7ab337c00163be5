"""The points of a synthetic scene, flights over them, and their projections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.types import Float64Array

_ALTITUDE_M = 100.0
_FORWARD_OVERLAP, _SIDE_OVERLAP = 0.75, 0.65
_RING_OVERLAP = 0.85  # one line alone has no photos beside it to rely on
# Standard deviation of the slope at which a photo looks down; a line of photos that all look down
# alike does not tell how they roll.
_TILT, _RING_TILT = 0.02, 0.15
_HILLS_M = 6.0  # amplitude of each of the waves that make the hills
_HILL_LENGTHS_M = (37.0, 61.0, 95.0, 170.0)
_ORBIT_RADIUS_M, _BALL_RADIUS_M = 40.0, 12.0
# A surface is visible if the cosine between its normal and the viewing ray exceeds this.
_FACING = 0.35


@dataclass(frozen=True, eq=False)
class World:
    """Points (P, 3) with what makes them keypoints, sorted by square tile.

    ``normals`` (P, 3): the side from which points are visible. ``strokes`` (P, 3): a short line in
    the world at each point; its projection gives the keypoint's scale and orientation.
    ``strengths`` (P,) in [0, 1). Tile (row, column) holds the points from
    ``tile_starts[row, column]`` up to the next start; ``tile_starts`` has one more column than
    there are tiles. ``reach_m``: a photo sees nothing farther than this from the point below it.
    """

    points: Float64Array
    normals: Float64Array
    strokes: Float64Array
    strengths: Float64Array
    tile_starts: NDArray[np.int64]
    tile_origin: Float64Array
    tile_size_m: float
    reach_m: float

    def project(
        self, camera: pycolmap.Camera, cam_from_world: pycolmap.Rigid3d
    ) -> tuple[NDArray[np.int64], Float64Array, Float64Array]:
        """The points a photo sees: ids (N,), pixels (N, 2) and strokes in pixels (N, 2)."""
        rotation = cam_from_world.rotation.matrix()
        centre = -rotation.T @ cam_from_world.translation
        ids = self._near(centre[:2])
        towards = centre - self.points[ids]
        distances = np.sqrt(np.einsum("nd,nd->n", towards, towards))
        facing = np.einsum("nd,nd->n", self.normals[ids], towards)
        ids = ids[facing > _FACING * distances]
        in_camera = self.points[ids] @ rotation.T + cam_from_world.translation
        # Distortion may map points far outside the picture back into it.
        ahead = in_camera[:, 2] > np.hypot(in_camera[:, 0], in_camera[:, 1])
        ids, in_camera = ids[ahead], in_camera[ahead]
        pixels = np.asarray(camera.img_from_cam(in_camera))
        inside = ((pixels >= 0) & (pixels < (camera.width, camera.height))).all(axis=1)
        ids, in_camera, pixels = ids[inside], in_camera[inside], pixels[inside]
        ends = in_camera + self.strokes[ids] @ rotation.T
        return ids, pixels, np.asarray(camera.img_from_cam(ends)) - pixels

    def _near(self, place: Float64Array) -> NDArray[np.int64]:
        """Ids of the points in tiles within reach of a place (2,): one run of ids per tile row."""
        rows, columns = self.tile_starts.shape[0], self.tile_starts.shape[1] - 1
        low = np.floor((place - self.reach_m - self.tile_origin) / self.tile_size_m).astype(int)
        high = np.floor((place + self.reach_m - self.tile_origin) / self.tile_size_m).astype(int)
        (left, bottom), (right, top) = np.maximum(low, 0), np.minimum(high, (columns - 1, rows - 1))
        runs = [
            np.arange(self.tile_starts[row, left], self.tile_starts[row, right + 1])
            for row in range(bottom, top + 1)
        ]
        return np.concatenate(runs) if runs else np.empty(0, dtype=np.int64)


def fly_orbit(
    num_images: int, points_per_image: int, rng: np.random.Generator
) -> tuple[World, tuple[pycolmap.Rigid3d, ...]]:
    """A circle around a lumpy ball."""
    # The cap of the ball that is visible from this distance.
    cap = np.arccos(_FACING) - np.arcsin(_BALL_RADIUS_M / _ORBIT_RADIUS_M * np.sqrt(1 - _FACING**2))
    count = round(points_per_image * 2.0 / (1.0 - np.cos(cap)))
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lumps = np.sin(normals @ rng.normal(0.0, 3.0, (3, 6)) + rng.random(6) * 2 * np.pi).sum(axis=1)
    points = normals * (_BALL_RADIUS_M + 0.5 * lumps)[:, None]
    poses = []
    for angle in 2.0 * np.pi * np.arange(num_images) / num_images:
        climb = 0.35 * np.sin(3.0 * angle) + 0.02 * rng.normal()
        away = np.array(
            [np.cos(angle) * np.cos(climb), np.sin(angle) * np.cos(climb), np.sin(climb)]
        )
        centre = _ORBIT_RADIUS_M * rng.normal(1.0, 0.02) * away
        poses.append(_look(centre, rng.normal(0.0, 0.5, 3), up=np.array([0.0, 0.0, 1.0])))
    everywhere = 2.0 * _BALL_RADIUS_M
    world = _tiled(points, normals, rng, tile_size_m=2 * everywhere, reach_m=2 * _ORBIT_RADIUS_M)
    return world, tuple(poses)


def fly_strip(
    num_images: int, points_per_image: int, camera: pycolmap.Camera, rng: np.random.Generator
) -> tuple[World, tuple[pycolmap.Rigid3d, ...]]:
    """Parallel lines over hills, flown to and fro."""
    width, depth = _footprint(camera)
    # The picture's width is across the flight direction, as usual in a survey.
    step, spacing = depth * (1 - _FORWARD_OVERLAP), width * (1 - _SIDE_OVERLAP)
    photos_a_line = max(1, round(np.sqrt(num_images * spacing / step)))
    line, place = np.divmod(np.arange(num_images), photos_a_line)
    back = line % 2 == 1
    along = np.where(back, photos_a_line - 1 - place, place) * step
    centres = _in_wind(np.column_stack([along, line * spacing]), rng)
    courses = np.column_stack([np.where(back, -1.0, 1.0), np.zeros(num_images)])
    poses = _looking_down(centres, courses, _TILT, rng)
    reach = 0.75 * float(np.hypot(width, depth))
    low, high = centres[:, :2].min(axis=0) - reach, centres[:, :2].max(axis=0) + reach
    count = round(points_per_image * float(np.prod(high - low)) / (width * depth))
    return _hills(low + rng.random((count, 2)) * (high - low), reach, rng), poses


def fly_ring(
    num_images: int, points_per_image: int, camera: pycolmap.Camera, rng: np.random.Generator
) -> tuple[World, tuple[pycolmap.Rigid3d, ...]]:
    """A single round trip over hills: only its end meets its beginning."""
    width, depth = _footprint(camera)
    reach = 0.75 * float(np.hypot(width, depth))
    radius = num_images * depth * (1 - _RING_OVERLAP) / (2 * np.pi)
    angles = 2 * np.pi * np.arange(num_images) / num_images
    outward = np.column_stack([np.cos(angles), np.sin(angles)])
    courses = outward[:, ::-1] * (-1.0, 1.0)
    poses = _looking_down(_in_wind(radius * outward, rng), courses, _RING_TILT, rng)
    inner, outer = max(0.0, radius - reach), radius + reach
    count = round(points_per_image * np.pi * (outer**2 - inner**2) / (width * depth))
    away = np.sqrt(rng.uniform(inner**2, outer**2, count))
    around = rng.uniform(0.0, 2 * np.pi, count)
    ground = away[:, None] * np.column_stack([np.cos(around), np.sin(around)])
    return _hills(ground, reach, rng), poses


def _footprint(camera: pycolmap.Camera) -> tuple[float, float]:
    """Width and depth in metres of what a photo shows of flat ground."""
    return (
        _ALTITUDE_M * camera.width / camera.mean_focal_length(),
        _ALTITUDE_M * camera.height / camera.mean_focal_length(),
    )


def _in_wind(route: Float64Array, rng: np.random.Generator) -> Float64Array:
    """(N, 3) places that are flown through near these (N, 2)."""
    centres = np.column_stack([route, np.full(len(route), _ALTITUDE_M)])
    shaken: Float64Array = centres + rng.normal(0.0, (1.0, 1.0, 2.0), centres.shape)
    return shaken


def _looking_down(
    centres: Float64Array, courses: Float64Array, slope: float, rng: np.random.Generator
) -> tuple[pycolmap.Rigid3d, ...]:
    """Poses at ``centres`` (N, 3), the top of the picture towards ``courses`` (N, 2), roughly.

    ``slope``: standard deviation of how far they look aside, in altitudes."""
    poses = []
    for centre, (east, north) in zip(centres, courses, strict=True):
        tilt = rng.normal(0.0, slope * _ALTITUDE_M, 2)
        target = np.array([*(centre[:2] + tilt), 0.0])
        heading = np.array([east, north + 0.05 * rng.normal(), 0.0])
        poses.append(_look(centre, target, up=heading))
    return tuple(poses)


def _hills(ground: Float64Array, reach: float, rng: np.random.Generator) -> World:
    """Points over the places ``ground`` (P, 2), as seen by photos that reach so far, in metres."""
    height = rng.gamma(1.0, 0.6, len(ground))  # bushes and roofs
    for length in _HILL_LENGTHS_M:
        direction = rng.random() * 2 * np.pi
        phase = ground @ (np.cos(direction), np.sin(direction)) * (2 * np.pi / length)
        amplitude = _HILLS_M * length / max(_HILL_LENGTHS_M)
        height += amplitude * np.sin(phase + rng.random() * 2 * np.pi)
    normals = np.tile((0.0, 0.0, 1.0), (len(ground), 1))
    points = np.column_stack([ground, height])
    return _tiled(points, normals, rng, tile_size_m=reach / 3, reach_m=reach)


def _look(centre: Float64Array, target: Float64Array, *, up: Float64Array) -> pycolmap.Rigid3d:
    """cam_from_world of a camera at ``centre``; x right, y down, z forward, as in COLMAP."""
    forward = (target - centre) / np.linalg.norm(target - centre)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), -rotation @ centre)


def _tiled(
    points: Float64Array,
    normals: Float64Array,
    rng: np.random.Generator,
    *,
    tile_size_m: float,
    reach_m: float,
) -> World:
    origin = points[:, :2].min(axis=0)
    tile = np.floor((points[:, :2] - origin) / tile_size_m).astype(np.int64)
    columns, rows = tile.max(axis=0) + 1
    flat = tile[:, 1] * columns + tile[:, 0]
    order = np.argsort(flat, kind="stable")
    starts = np.searchsorted(flat[order], np.arange(rows * columns + 1))
    grid = np.arange(rows)[:, None] * columns + np.arange(columns + 1)[None, :]
    sideways = np.cross(normals, rng.normal(size=normals.shape))
    sideways /= np.linalg.norm(sideways, axis=1, keepdims=True)
    # So that keypoints have the scale of SIFT's at these distances: mostly 2 to 6 pixels.
    lengths = np.exp(rng.normal(0.0, 0.5, (len(points), 1))) * reach_m / 350.0
    return World(
        points=points[order],
        normals=normals[order],
        strokes=(sideways * lengths)[order],
        strengths=rng.random(len(points)),
        tile_starts=starts[grid],
        tile_origin=origin,
        tile_size_m=tile_size_m,
        reach_m=reach_m,
    )
