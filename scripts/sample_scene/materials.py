"""The reflectance of surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .mesh import Material
from .noise import Floats, Ints, fractal, hash_cells, spots, unit
from .terrain import ROAD_HALF_WIDTH_M, fields, road_distance


@dataclass(frozen=True, eq=False)
class Surface:
    """N points on surfaces of one material.

    ``xyz`` and ``normal`` (N, 3) in world coordinates, ``owner`` (N,) the object, ``origin`` (N, 3)
    and ``radius`` (N,) its place and radius, ``footprint`` (N,) metres per pixel.
    """

    xyz: Floats
    normal: Floats
    owner: Ints
    origin: Floats
    radius: Floats
    footprint: Floats

    def noise(self, seed: int, cell: float, octaves: int, gain: float = 0.6) -> Floats:
        """Fractal noise in world coordinates, in about [-1, 1]."""
        return fractal(
            self.xyz, seed, cell=cell, octaves=octaves, gain=gain, footprint=self.footprint
        )

    def draw(self, number: int) -> Floats:
        """A random number in [0, 1), constant over an object."""
        return unit(hash_cells(self.owner[:, None], 77), number)

    def tint(self, low: tuple[float, float, float], high: tuple[float, float, float]) -> Floats:
        """A random colour (N, 3) between two, constant over an object."""
        share = np.stack([self.draw(number) for number in (11, 12, 13)], axis=1)
        lowest = np.array(low, dtype=np.float32)
        return lowest + (np.array(high, dtype=np.float32) - lowest) * share

    def unrolled(self) -> tuple[Floats, Floats]:
        """Metres along the surface (N,): horizontally, and up."""
        offset = self.xyz - self.origin
        level = np.stack([-self.normal[:, 1], self.normal[:, 0]], axis=1)
        steepness = np.linalg.norm(level, axis=1)
        flat = steepness < 1e-3
        steepness = np.maximum(steepness, 1e-3)
        level = np.where(flat[:, None], np.array([1.0, 0.0]), level / steepness[:, None])
        along = (offset[:, :2] * level).sum(axis=1)
        around = np.arctan2(offset[:, 1], offset[:, 0]) * self.radius
        up = np.where(flat, offset[:, 1], offset[:, 2] / steepness)
        return (
            np.where(self.radius > 0, around, along).astype(np.float32),
            up.astype(np.float32),
        )


def reflectance(material: Material, surface: Surface) -> Floats:
    """Linear RGB (N, 3) in [0, 1]."""
    return np.clip(_RECIPES[material](surface), 0.01, 0.95).astype(np.float32)


def mix(base: Floats, other: Floats | tuple[float, float, float], share: Floats) -> Floats:
    """Blend colours (N, 3) by a share (N,), clipped to [0, 1]."""
    share = np.clip(share, 0.0, 1.0)[:, None]
    return (base * (1.0 - share) + np.asarray(other, dtype=np.float32) * share).astype(np.float32)


def _plain(count: int, colour: tuple[float, float, float]) -> Floats:
    return np.broadcast_to(np.array(colour, dtype=np.float32), (count, 3))


# What lies and grows about: seed, square per piece in metres, share of squares, darkest and
# lightest colour. Bushes, stones, tufts, pebbles.
_LITTER = (
    (4, 2.9, 0.45, ((0.03, 0.06, 0.015), (0.11, 0.13, 0.03))),
    (5, 1.7, 0.22, ((0.12, 0.11, 0.09), (0.36, 0.34, 0.29))),
    (6, 0.8, 0.40, ((0.035, 0.07, 0.02), (0.24, 0.22, 0.07))),
    (7, 0.5, 0.14, ((0.16, 0.14, 0.11), (0.42, 0.40, 0.34))),
)
_FIELDS_FROM_M = 44.0  # fields begin this far from the origin


def _ground(s: Surface) -> Floats:
    xy = s.xyz[:, :2]

    def noise(seed: int, cell: float, octaves: int, gain: float = 0.6) -> Floats:
        return fractal(xy, seed, cell=cell, octaves=octaves, gain=gain, footprint=s.footprint)

    patches, fine, grain = noise(1, 26.0, 4), noise(2, 2.4, 5, 0.72), noise(11, 0.4, 3, 0.9)
    colour = mix(_plain(len(xy), (0.075, 0.125, 0.03)), (0.21, 0.19, 0.07), 0.4 + 0.8 * patches)
    outside = np.hypot(xy[:, 0], xy[:, 1]) > _FIELDS_FROM_M
    colour[outside] = _crops(xy[outside], s.footprint[outside], colour[outside], patches[outside])
    colour = colour * (1.0 + 0.6 * fine + 0.5 * grain)[:, None]
    bare = noise(3, 9.0, 6) - 0.4
    colour = mix(colour, (0.25, 0.17, 0.10), 3.0 * bare)
    for seed, cell, share, palette in _LITTER:
        depth, hashes = spots(xy, seed, cell=cell, share=share)
        ragged = 5.0 * (depth - 0.3 + 0.45 * fine) * (depth > 0)
        shown = np.clip(ragged, 0.0, 0.85) * np.clip(cell / s.footprint / 4.0 - 0.5, 0.0, 1.0)
        low, high = np.array(palette, dtype=np.float32)
        blot = low + (high - low) * unit(hashes, 7)[:, None]
        colour = mix(colour, blot * (1.0 + 0.5 * fine)[:, None], shown)
    steep = (0.85 - s.normal[:, 2]) * 9.0 + 0.9 * fine
    strata = s.xyz * np.array([0.45, 0.45, 1.6], dtype=np.float32)
    cracks = fractal(strata, 17, cell=1.5, octaves=5, gain=0.85, footprint=s.footprint)
    cliff = _plain(len(xy), (0.27, 0.235, 0.18)) * (1.0 + 0.95 * cracks + 0.3 * grain)[:, None]
    colour = mix(colour, cliff.astype(np.float32), steep)
    edge = ROAD_HALF_WIDTH_M + 0.7 * noise(8, 3.0, 4) - road_distance(xy)
    gravel = _plain(len(xy), (0.37, 0.30, 0.20)) * (1.0 + 0.6 * noise(9, 0.9, 5, 0.9))[:, None]
    return mix(colour, gravel.astype(np.float32), 2.0 * edge + 0.4 + 0.4 * grain)


def _crops(xy: Floats, footprint: Floats, grass: Floats, patches: Floats) -> Floats:
    """Fields around the village, each with its own crop and direction of ploughing."""
    owner, edge = fields(xy)
    palette = np.array(
        [(0.36, 0.29, 0.12), (0.16, 0.21, 0.05), (0.24, 0.16, 0.09), (0.30, 0.31, 0.10)],
        dtype=np.float32,
    )
    crop = palette[(unit(owner, 3) * len(palette)).astype(int)]
    crop = crop * (0.75 + 0.5 * unit(owner, 4))[:, None]
    angle = np.pi * unit(owner, 5)
    across = xy[:, 0] * np.cos(angle) + xy[:, 1] * np.sin(angle) + 0.6 * patches
    rows = np.sin(across * (2.0 * np.pi / (1.2 + unit(owner, 6)))) * (0.6 + 0.5 * patches)
    crop = crop * (1.0 + 0.18 * rows * np.clip(0.5 / footprint - 1.0, 0.0, 1.0))[:, None]
    outside = np.clip((np.hypot(xy[:, 0], xy[:, 1]) - _FIELDS_FROM_M) / 10.0, 0.0, 1.0)
    return mix(grass, crop.astype(np.float32), outside * np.clip(edge - 0.8, 0.0, 1.0))


def _blocks(
    s: Surface, row: float, length: float, joint: float, seed: int
) -> tuple[Floats, Floats]:
    """Courses of blocks of random length: a random number per block, and 1 in the joints."""
    along, up = s.unrolled()
    along = along + 0.05 * s.noise(seed + 1, 0.7, 2)
    course = np.floor(up / row)
    key = np.stack([course, s.owner], axis=1).astype(np.int32)
    hashes = hash_cells(key, seed)
    scaled = along / (length * (0.75 + 0.5 * unit(hashes, 1))) + 16.0 * unit(hashes, 2)
    block = np.floor(scaled)
    shade = unit(hash_cells(np.column_stack([key, block]).astype(np.int32), seed + 2))
    to_end = (0.5 - np.abs(scaled - block - 0.5)) * length
    to_bed = (0.5 - np.abs(up / row - course - 0.5)) * row
    to_joint = np.minimum(to_end, to_bed)
    visible = np.clip(row / s.footprint / 2.0 - 1.0, 0.0, 1.0)
    return shade, np.clip(1.0 - to_joint / joint, 0.0, 1.0) * visible


def _stone(s: Surface) -> Floats:
    shade, joints = _blocks(s, 0.52, 0.95, 0.09, 20)
    colour = _plain(len(s.xyz), (0.40, 0.355, 0.28)) * (0.55 + 0.8 * shade)[:, None]
    colour = colour * (1.0 + 0.35 * s.noise(24, 0.9, 5, 0.75))[:, None]
    colour = mix(colour.astype(np.float32), (0.10, 0.09, 0.07), 0.7 * joints)
    stains = s.noise(25, 5.0, 4)
    colour = mix(colour, (0.12, 0.12, 0.09), 0.9 * (stains - 0.25))
    return mix(colour, (0.15, 0.19, 0.06), 1.3 * (s.noise(26, 3.0, 5) - 0.5))


def _plaster(s: Surface) -> Floats:
    tint = s.tint((0.62, 0.55, 0.44), (0.48, 0.39, 0.24))
    colour = tint * (1.0 + 0.2 * s.noise(30, 1.6, 6, 0.75))[:, None]
    peeled = 2.5 * (s.noise(31, 2.6, 5) - 0.35)
    shade, joints = _blocks(s, 0.28, 0.5, 0.06, 32)
    masonry = _plain(len(s.xyz), (0.36, 0.24, 0.17)) * (0.6 + 0.7 * shade - 0.3 * joints)[:, None]
    colour = mix(colour.astype(np.float32), masonry.astype(np.float32), peeled)
    above = s.xyz[:, 2] - s.origin[:, 2]
    colour = mix(colour, (0.22, 0.19, 0.14), 0.7 - 0.6 * above + 0.5 * s.noise(33, 1.2, 4))
    return _windows(s, colour, above)


def _windows(s: Surface, colour: Floats, above: Floats) -> Floats:
    """Windows in about half of the possible places, different on every house."""
    along, _ = s.unrolled()
    width = 2.0 + 0.9 * s.draw(4)
    side = np.round(np.arctan2(s.normal[:, 1], s.normal[:, 0]) * 2.0)
    column, storey = np.floor(along / width), np.floor((above - 0.7) / 2.3)
    key = np.stack([column + 64 * side, storey, s.owner], axis=1).astype(np.int32)
    hashes = hash_cells(key, 40)
    centre = 0.5 + 0.3 * (unit(hashes, 1) - 0.5)
    from_side = np.abs(along / width - column - centre) * width
    from_middle = np.abs(above - 0.7 - 2.3 * storey - 0.8)
    half_width, half_height = 0.32 + 0.2 * unit(hashes, 2), 0.5 + 0.25 * unit(hashes, 3)
    upright = (np.abs(s.normal[:, 2]) < 0.1) & (unit(hashes) < 0.6) & (storey >= 0)
    depth = np.minimum(half_width - from_side, half_height - from_middle)
    shutters = np.abs(from_side - half_width - 0.22) < 0.2
    shutters &= (from_middle < half_height) & (unit(hashes, 4) < 0.6)
    wood = s.tint((0.12, 0.10, 0.08), (0.36, 0.26, 0.16))
    colour = mix(colour, wood, (upright & shutters) * 0.95)
    colour = mix(colour, (0.55, 0.53, 0.48), (upright & (depth > -0.1)) * 0.9)
    return mix(colour, (0.035, 0.04, 0.05), (upright & (depth > 0.0)) * 1.0)


def _tiles(s: Surface) -> Floats:
    shade, joints = _blocks(s, 0.34, 0.36, 0.05, 50)
    return _weathered_roof(s, s.tint((0.38, 0.15, 0.07), (0.52, 0.22, 0.13)), shade, joints)


def _slate(s: Surface) -> Floats:
    shade, joints = _blocks(s, 0.34, 0.45, 0.05, 60)
    return _weathered_roof(s, s.tint((0.17, 0.18, 0.20), (0.23, 0.23, 0.25)), shade, joints)


def _weathered_roof(s: Surface, tint: Floats, shade: Floats, joints: Floats) -> Floats:
    colour = tint * (0.55 + 0.9 * shade)[:, None] * (1.0 - 0.45 * joints)[:, None]
    colour = colour * (1.0 + 0.25 * s.noise(52, 1.7, 5, 0.7))[:, None]
    colour = mix(colour.astype(np.float32), (0.10, 0.085, 0.065), 1.2 * (s.noise(53, 2.8, 5) - 0.3))
    return mix(colour, (0.27, 0.28, 0.15), 2.0 * (s.noise(54, 1.1, 4) - 0.55))


def _leaves(s: Surface) -> Floats:
    tint = s.tint((0.07, 0.13, 0.03), (0.19, 0.21, 0.06))
    return tint * (1.0 + 0.75 * s.noise(70, 1.1, 5, 0.8))[:, None]


def _rock(s: Surface) -> Floats:
    colour = _plain(len(s.xyz), (0.36, 0.335, 0.29)) * (0.75 + 0.4 * s.draw(1))[:, None]
    colour = colour * (1.0 + 0.5 * s.noise(80, 0.9, 5, 0.8))[:, None]
    return mix(colour.astype(np.float32), (0.30, 0.29, 0.10), 1.5 * (s.noise(81, 0.8, 4) - 0.45))


def _wood(s: Surface) -> Floats:
    return _plain(len(s.xyz), (0.14, 0.10, 0.07)) * (1.0 + 0.4 * s.noise(90, 0.5, 3))[:, None]


_RECIPES: dict[Material, Callable[[Surface], Floats]] = {
    Material.GROUND: _ground,
    Material.STONE: _stone,
    Material.PLASTER: _plaster,
    Material.TILES: _tiles,
    Material.SLATE: _slate,
    Material.LEAVES: _leaves,
    Material.ROCK: _rock,
    Material.WOOD: _wood,
}
