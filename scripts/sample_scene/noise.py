"""Random values that depend only on a position in the world and a seed.

Every photo sees the same texture because it is a function of the surface point; nothing repeats
because cells are hashed, not looked up in a table.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
Ints = NDArray[np.int32]
Hashes = NDArray[np.uint32]

# One odd constant per axis, as in C. Ericson, Real-Time Collision Detection (2005), 7.1.3.
_STRIDES = np.array([0x8DA6B343, 0xD8163841, 0xCB1AB31F], dtype=np.uint32)
# Rotating each octave hides the lattice of value noise.
_OCTAVE_TURN_RAD = 0.61
_BLOCK = 1 << 12  # points per step, which fit the processor's cache


def hash_cells(cells: Ints, seed: int | Ints) -> Hashes:
    """Hash integer cells (N, D), D up to 3, and a seed, one or one per cell, to (N,) uint32."""
    mixed = np.asarray(seed).astype(np.uint32) * np.uint32(0x9E3779B1)
    key = np.broadcast_to(mixed, (len(cells),)).copy()
    for axis in range(cells.shape[1]):
        key += cells[:, axis].astype(np.uint32) * _STRIDES[axis]
    return _mix(key)


def unit(hashes: Hashes, draw: int = 0) -> Floats:
    """The ``draw``-th independent number in [0, 1) of each hash."""
    if draw:
        hashes = _mix(hashes + np.uint32((draw * 0x85EBCA6B) & 0xFFFFFFFF))
    noise: Floats = (hashes >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)
    return noise


def value_noise(points: Floats, seed: int) -> Floats:
    """Smooth noise in [-1, 1] with unit cells at points (N, 2) or (N, 3)."""
    out = np.empty(len(points), dtype=np.float32)
    for start in range(0, len(points), _BLOCK):
        out[start : start + _BLOCK] = _value_noise(points[start : start + _BLOCK], seed)
    return out


def fractal(
    points: Floats,
    seed: int,
    *,
    cell: float,
    octaves: int,
    gain: float = 0.6,
    footprint: Floats | None = None,
) -> Floats:
    """Sum of ``octaves`` of noise in about [-1, 1]; ``cell`` is the size of the coarsest in metres.

    An octave fades out as its cells approach ``footprint`` (N,), the size of a pixel on the
    surface: detail below a pixel would differ randomly from photo to photo.
    """
    total = np.zeros(len(points), dtype=np.float32)
    norm = 0.0
    amplitude = 1.0
    cos, sin = np.cos(_OCTAVE_TURN_RAD), np.sin(_OCTAVE_TURN_RAD)
    turn = np.array([[cos, sin], [-sin, cos]], dtype=np.float32)
    turned = points.astype(np.float32, copy=True)
    for octave in range(octaves):
        values = value_noise(turned / np.float32(cell), seed + octave)
        if footprint is not None:
            values *= np.clip(1.5 * cell / footprint - 1.0, 0.0, 1.0)
        total += np.float32(amplitude) * values
        norm += amplitude**2
        amplitude *= gain
        cell *= 0.5
        turned[:, :2] = turned[:, :2] @ turn
    # Octaves are independent: their variances add up.
    scaled: Floats = total / np.float32(1.4 * np.sqrt(norm))
    return scaled


def spots(points: Floats, seed: int, *, cell: float, share: float) -> tuple[Floats, Hashes]:
    """One round spot in a ``share`` of the square cells of points (N, 2).

    Returns the depth of each point in its spot (N,), 0 outside to 1 in the middle, and its cell's
    hash, for colours.
    """
    scaled = points / np.float32(cell)
    corner = np.floor(scaled)
    hashes = hash_cells(corner.astype(np.int32), seed)
    radius = 0.12 + 0.28 * unit(hashes, 1)
    centre = np.stack([unit(hashes, 2), unit(hashes, 3)], axis=1)
    centre = radius[:, None] + (1.0 - 2.0 * radius[:, None]) * centre
    offset = scaled - corner - centre
    distance = np.hypot(offset[:, 0], offset[:, 1])
    depth = np.clip(1.0 - distance / radius, 0.0, 1.0)
    return np.where(unit(hashes) < share, depth, 0.0).astype(np.float32), hashes


def _value_noise(points: Floats, seed: int) -> Floats:
    points = points.T
    corner = np.floor(points)
    weight = points - corner
    weight *= weight * (3.0 - 2.0 * weight)
    dimensions = len(points)
    low = corner.astype(np.int32).astype(np.uint32) * _STRIDES[:dimensions, None]
    keys = np.full((1, points.shape[1]), (seed * 0x9E3779B1) & 0xFFFFFFFF, dtype=np.uint32)
    for axis in reversed(range(dimensions)):
        near = keys + low[axis]
        keys = np.concatenate([near, near + _STRIDES[axis]])
    values = unit(_mix(keys))
    for axis in range(dimensions):
        half = len(values) // 2
        values = values[:half] + weight[axis] * (values[half:] - values[:half])
    noise: Floats = 2.0 * values[0] - 1.0
    return noise


def _mix(key: Hashes) -> Hashes:
    """Spread a key's bits over the whole word (the lowbias32 finaliser, C. Wellons, public)."""
    key = key ^ (key >> np.uint32(16))
    key *= np.uint32(0x7FEB352D)
    key ^= key >> np.uint32(15)
    key *= np.uint32(0x846CA68B)
    key ^= key >> np.uint32(16)
    return key
