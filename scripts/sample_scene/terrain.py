"""The terrain: height of the ground, roads and fields."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .mesh import Material, MeshBuilder, grid_triangles
from .noise import Floats, Hashes, fractal, hash_cells

CASTLE_XY = (-16.0, 14.0)
_SEED = 100
_HALF_SIZE_M = 900.0
_NUM_STEPS = 620

# Centre lines in metres east and north of the origin.
ROADS = tuple(
    np.array(places, dtype=np.float32)
    for places in (
        ((-75, -62), (-48, -40), (-22, -27), (2, -21), (22, -12), (36, 4), (48, 26), (70, 60)),
        ((2, -21), (-2, -8), (-8, 0), (-19, -3), (-31, 4), (-30, 14), (-22, 16)),
        ((22, -12), (34, -22), (52, -34), (88, -42)),
        ((36, 4), (22, 16), (12, 34), (6, 62), (-8, 90)),
    )
)
ROAD_HALF_WIDTH_M = 1.3


def height(points: Floats) -> Floats:
    """Metres above the origin of the ground under points (N, 2)."""
    x, y = points[:, 0], points[:, 1]
    rolling = 5.5 * fractal(points, _SEED, cell=75.0, octaves=3, gain=0.45)
    rough = 0.5 * fractal(points, _SEED + 10, cell=11.0, octaves=5, gain=0.5)
    off_castle = np.hypot(x - CASTLE_XY[0], (y - CASTLE_XY[1]) * 1.15)
    wobble = 4.0 * fractal(points, _SEED + 20, cell=16.0, octaves=4)
    hill = 6.5 * (1.0 - np.tanh((off_castle + wobble - 22.0) / 7.2))
    off_valley = y + 48.0 - 0.32 * x - 9.0 * np.sin(x / 23.0)
    valley = -6.5 * np.exp(-((off_valley / 9.5) ** 2))
    # Level where people walk, rough elsewhere.
    smooth = np.clip(road_distance(points) / 4.0, 0.15, 1.0)
    total: Floats = rolling + rough * smooth + hill + valley
    return total


def height_at(x: float, y: float) -> float:
    """Metres above the origin of the ground at one place."""
    return float(height(np.array([[x, y]], dtype=np.float32))[0])


def road_distance(points: Floats) -> Floats:
    """Metres from points (N, 2) to the nearest road's centre line."""
    nearest = np.full(len(points), np.inf, dtype=np.float32)
    for road in ROADS:
        for start, end in pairwise(road):
            along = end - start
            offset = points - start
            share = np.clip(offset @ along / np.float32(along @ along), 0.0, 1.0)
            offset -= share[:, None] * along
            distance = np.hypot(offset[:, 0], offset[:, 1])
            nearest = np.minimum(nearest, distance)
    return nearest


def fields(points: Floats) -> tuple[Hashes, Floats]:
    """The field of each point (N, 2), as a hash, and the metres to the field's edge.

    Fields are the cells of a Voronoi diagram with one random seed per square.
    """
    size = np.float32(38.0)
    bent = points + 2.5 * np.stack(
        [fractal(points, _SEED + 40 + axis, cell=30.0, octaves=2) for axis in range(2)], axis=1
    )
    corner = np.floor(bent / size).astype(np.int32)
    best = np.full(len(points), np.inf, dtype=np.float32)
    second = best.copy()
    owner = np.zeros(len(points), dtype=np.uint32)
    for shift in np.ndindex(3, 3):
        cell = corner + (np.array(shift, dtype=np.int32) - 1)
        hashes = hash_cells(cell, _SEED + 50)
        jitter = np.stack([hashes & 0xFFFF, hashes >> np.uint32(16)], axis=1) / 65536.0
        offset = bent - (cell + jitter).astype(np.float32) * size
        distance = np.hypot(offset[:, 0], offset[:, 1])
        closer = distance < best
        second = np.where(closer, best, np.minimum(second, distance))
        owner = np.where(closer, hashes, owner)
        best = np.minimum(best, distance)
    return owner, 0.5 * (second - best)


def add_ground(builder: MeshBuilder) -> None:
    """Add the terrain, coarser at the rim, which is only seen on the horizon."""
    steps = np.linspace(-1.0, 1.0, _NUM_STEPS + 1)
    axis: NDArray[np.float64] = _HALF_SIZE_M * (0.14 * steps + 0.86 * steps**5)
    x, y = np.meshgrid(axis, axis)
    points = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)
    vertices = np.column_stack([points, height(points)]).astype(np.float32)
    builder.start((0.0, 0.0, 0.0))
    builder.add(vertices, grid_triangles(_NUM_STEPS, _NUM_STEPS), Material.GROUND)
