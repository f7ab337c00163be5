"""Pieces of geometry, joined into one triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from .noise import Floats, value_noise

Triangles = NDArray[np.uint32]


class Material(IntEnum):
    """What a surface is made of."""

    GROUND = 0
    STONE = 1
    PLASTER = 2
    TILES = 3
    SLATE = 4
    LEAVES = 5
    ROCK = 6
    WOOD = 7


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh with what shading needs.

    ``vertices`` and ``normals`` (V, 3) float32, ``triangles`` (T, 3) uint32. ``material`` and
    ``owner`` (T,): the owner is the triangle's object, an index into ``origins`` (O, 3), the
    object's place, and ``radii`` (O,), 0 if it is not round.
    """

    vertices: Floats
    normals: Floats
    triangles: Triangles
    material: NDArray[np.uint8]
    owner: NDArray[np.int32]
    origins: Floats
    radii: Floats


@dataclass(eq=False)
class MeshBuilder:
    """Collects objects; ``build`` joins them."""

    _vertices: list[Floats] = field(default_factory=list)
    _triangles: list[Triangles] = field(default_factory=list)
    _material: list[NDArray[np.uint8]] = field(default_factory=list)
    _owner: list[NDArray[np.int32]] = field(default_factory=list)
    _origins: list[tuple[float, float, float]] = field(default_factory=list)
    _radii: list[float] = field(default_factory=list)
    _num_vertices: int = 0

    def start(self, origin: tuple[float, float, float], *, radius: float = 0.0) -> None:
        """Begin a new object, which the next pieces belong to."""
        self._origins.append(origin)
        self._radii.append(radius)

    def add(self, vertices: Floats, triangles: Triangles, material: Material) -> None:
        """Add a piece to the current object; pieces share no vertices, so edges stay sharp."""
        self._vertices.append(vertices.astype(np.float32))
        self._triangles.append((triangles + self._num_vertices).astype(np.uint32))
        self._material.append(np.full(len(triangles), material, dtype=np.uint8))
        self._owner.append(np.full(len(triangles), len(self._origins) - 1, dtype=np.int32))
        self._num_vertices += len(vertices)

    def quad(self, corners: Floats, material: Material, *, edge: float = 0.8) -> None:
        """A patch over four corners (4, 3), counter-clockwise seen from outside.

        It is cut into a grid of about ``edge`` metres, fine enough for ambient light per vertex.
        """
        a, b, c, d = corners.astype(np.float64)
        columns = max(1, round(float(np.linalg.norm(b - a)) / edge))
        rows = max(1, round(float(np.linalg.norm(d - a)) / edge))
        u = np.linspace(0.0, 1.0, columns + 1)[None, :, None]
        v = np.linspace(0.0, 1.0, rows + 1)[:, None, None]
        grid = (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * d + u * c)
        self.add(grid.reshape(-1, 3).astype(np.float32), grid_triangles(rows, columns), material)

    def box(self, frame: Floats, low: Floats, high: Floats, material: Material) -> None:
        """An upright box without a bottom between two corners (3,) of a local ``frame`` (3, 4)."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        ring = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        for (ax, ay), (bx, by) in zip(ring, ring[1:] + ring[:1], strict=True):
            side = np.array([(ax, ay, z0), (bx, by, z0), (bx, by, z1), (ax, ay, z1)])
            self.quad(to_world(frame, side), material)
        top = np.array([(x, y, z1) for x, y in ring])
        self.quad(to_world(frame, top), material)

    def tube(
        self,
        centre: tuple[float, float],
        bottom: tuple[float, float],
        top: tuple[float, float],
        material: Material,
        *,
        sides: int = 28,
    ) -> None:
        """A round wall or cone; ``bottom`` and ``top`` are (radius, height)."""
        rows = max(2, round(float(np.hypot(top[0] - bottom[0], top[1] - bottom[1]))))
        angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)[None, :]
        share = np.linspace(0.0, 1.0, rows + 1)[:, None]
        radius = bottom[0] + (top[0] - bottom[0]) * share
        height = bottom[1] + (top[1] - bottom[1]) * share
        ring = np.stack(
            [
                centre[0] + radius * np.cos(angle),
                centre[1] + radius * np.sin(angle),
                np.broadcast_to(height, (rows + 1, sides + 1)),
            ],
            axis=-1,
        )
        self.add(ring.reshape(-1, 3).astype(np.float32), grid_triangles(rows, sides), material)

    def blob(self, centre: Floats, radii: Floats, seed: int, material: Material) -> None:
        """A lumpy ellipsoid: a tree's crown or a boulder."""
        rows, columns = 14, 22
        polar = np.linspace(0.02, np.pi - 0.02, rows + 1)[::-1, None]
        angle = np.linspace(0.0, 2.0 * np.pi, columns + 1)[None, :]
        sphere = np.stack(
            [
                np.sin(polar) * np.cos(angle),
                np.sin(polar) * np.sin(angle),
                np.broadcast_to(np.cos(polar), (rows + 1, columns + 1)),
            ],
            axis=-1,
        )
        sphere = sphere.reshape(-1, 3).astype(np.float32)
        lumps = 0.28 * value_noise(sphere * 2.3, seed) + 0.14 * value_noise(sphere * 5.1, seed + 1)
        vertices = centre + sphere * radii * (1.0 + lumps[:, None])
        self.add(vertices, grid_triangles(rows, columns), material)

    def build(self) -> Mesh:
        """Join everything added so far."""
        vertices = np.concatenate(self._vertices)
        triangles = np.concatenate(self._triangles)
        return Mesh(
            vertices=vertices,
            normals=_vertex_normals(vertices, triangles),
            triangles=triangles,
            material=np.concatenate(self._material),
            owner=np.concatenate(self._owner),
            origins=np.array(self._origins, dtype=np.float32),
            radii=np.array(self._radii, dtype=np.float32),
        )


def local_frame(x: float, y: float, z: float, yaw: float) -> Floats:
    """(3, 4) world_from_local of an object at (x, y, z), rotated by ``yaw`` radians."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, 0, x], [sin, cos, 0, y], [0, 0, 1, z]], dtype=np.float32)


def to_world(frame: Floats, points: NDArray[np.floating]) -> Floats:
    """Local points (N, 3) in world coordinates."""
    moved: Floats = (points @ frame[:, :3].T + frame[:, 3]).astype(np.float32)
    return moved


def grid_triangles(rows: int, columns: int) -> Triangles:
    """Triangles of a grid of (rows + 1) x (columns + 1) vertices, row after row."""
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)[None, :]).ravel()
    above = first + columns + 1
    lower = np.stack([first, first + 1, above + 1], axis=1)
    upper = np.stack([first, above + 1, above], axis=1)
    return np.concatenate([lower, upper]).astype(np.uint32)


def _vertex_normals(vertices: Floats, triangles: Triangles) -> Floats:
    a, b, c = (vertices[triangles[:, corner]].astype(np.float64) for corner in range(3))
    face = np.cross(b - a, c - a)
    normals = np.zeros((len(vertices), 3))
    for corner in range(3):
        for axis in range(3):
            normals[:, axis] += np.bincount(
                triangles[:, corner], weights=face[:, axis], minlength=len(vertices)
            )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: Floats = (normals / np.maximum(length, 1e-12)).astype(np.float32)
    return unit
