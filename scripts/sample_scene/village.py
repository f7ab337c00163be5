"""The objects of the village: a castle, a church, houses, trees and boulders."""

from __future__ import annotations

import numpy as np

from .mesh import Material, Mesh, MeshBuilder, local_frame, to_world
from .noise import Floats
from .terrain import (
    CASTLE_XY,
    ROAD_HALF_WIDTH_M,
    ROADS,
    add_ground,
    fields,
    height,
    height_at,
    road_distance,
)

_NUM_HOUSES = 30
_NUM_TREES = 420
_NUM_BOULDERS = 140
# Corners of the castle's wall from its centre, counter-clockwise.
_CASTLE_CORNERS = np.array(
    [(-13.0, -8.5), (-2.0, -12.5), (12.0, -9.0), (13.5, 6.0), (-1.0, 12.0), (-14.0, 7.0)]
)


def build_village(seed: int) -> Mesh:
    """The whole scene as one mesh, in metres: x east, y north, z up."""
    rng = np.random.default_rng(seed)
    builder = MeshBuilder()
    add_ground(builder)
    _add_castle(builder)
    taken = [(CASTLE_XY[0], CASTLE_XY[1], 20.0)]
    taken.append(_add_church(builder))
    taken += _add_houses(builder, rng, taken)
    _add_boulders(builder, rng, taken)
    _add_trees(builder, rng, taken)
    return builder.build()


def _add_castle(builder: MeshBuilder) -> None:
    corners = _CASTLE_CORNERS + np.array(CASTLE_XY)
    for index, (start, end) in enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True)):
        gate = index == 1
        _add_wall(builder, start, end, top=5.0 + 0.35 * (index % 3), gap=3.2 if gate else 0.0)
        ground = height_at(*start)
        radius, wall = 2.2 + 0.25 * (index % 3), 8.0 + 1.1 * ((index * 2) % 5)
        foot, top = (radius * 1.08, ground - 4), (radius, ground + wall)
        builder.start((*start, ground), radius=radius)
        builder.tube(tuple(start), foot, top, Material.STONE)
        if index % 2:
            roof = ground + wall - 0.2
            builder.tube(tuple(start), (radius + 0.5, roof), (0.05, roof + 4.6), Material.SLATE)
        else:
            _add_crown(builder, tuple(start), radius, ground + wall)
    x, y = CASTLE_XY[0] + 4.0, CASTLE_XY[1] + 2.0
    ground = height_at(x, y)
    builder.start((x, y, ground))
    frame = local_frame(x, y, ground, 0.35)
    half = np.array([3.6, 3.1])
    builder.box(frame, np.array([*-half, -3.0]), np.array([*half, 15.0]), Material.STONE)
    for shift in np.arange(-3.1, 3.2, 1.55):
        for side in (-1.0, 1.0):
            _add_merlon(builder, frame, shift, side * (half[1] - 0.25), 15.0)
            _add_merlon(builder, frame, side * (half[0] - 0.25), shift * half[1] / half[0], 15.0)
    x, y = CASTLE_XY
    _add_gabled(builder, x - 6.5, y + 1.5, 1.25, (8.5, 4.6, 4.0), Material.SLATE)
    _add_gabled(builder, x + 3.0, y - 6.5, 0.12, (7.0, 3.6, 2.8), Material.TILES)


def _add_wall(builder: MeshBuilder, start: Floats, end: Floats, *, top: float, gap: float) -> None:
    """A curtain wall with battlements and a gate, ``gap`` metres wide, in its middle."""
    along = end - start
    length = float(np.hypot(*along))
    middle = 0.5 * (start + end)
    ground = min(height_at(*start), height_at(*middle), height_at(*end))
    frame = local_frame(middle[0], middle[1], ground, float(np.arctan2(along[1], along[0])))
    builder.start((middle[0], middle[1], ground))
    spans = [(-length / 2, -gap / 2), (gap / 2, length / 2)] if gap else [(-length / 2, length / 2)]
    for left, right in spans:
        low, high = np.array([left, -0.7, -4.0]), np.array([right, 0.7, top])
        builder.box(frame, low, high, Material.STONE)
        for shift in np.arange(left + 0.8, right - 0.4, 1.5):
            _add_merlon(builder, frame, shift, -0.45, top)
    if gap:
        low, high = np.array([-gap / 2, -0.9, 3.4]), np.array([gap / 2, 0.9, top + 1.2])
        builder.box(frame, low, high, Material.STONE)


def _add_merlon(builder: MeshBuilder, frame: Floats, x: float, y: float, z: float) -> None:
    low, high = np.array([x - 0.42, y - 0.25, z]), np.array([x + 0.42, y + 0.25, z + 0.9])
    builder.box(frame, low, high, Material.STONE)


def _add_crown(
    builder: MeshBuilder, centre: tuple[float, float], radius: float, top: float
) -> None:
    """The flat top of a tower and the battlements around it."""
    builder.tube(centre, (radius, top - 0.01), (0.02, top), Material.STONE)
    for angle in np.arange(0.0, 2.0 * np.pi, np.pi / 5):
        x = centre[0] + (radius - 0.25) * np.cos(angle)
        y = centre[1] + (radius - 0.25) * np.sin(angle)
        _add_merlon(builder, local_frame(x, y, top, angle + np.pi / 2), 0.0, 0.0, -0.05)


def _add_church(builder: MeshBuilder) -> tuple[float, float, float]:
    x, y, yaw = 13.5, 6.5, 0.5
    _add_gabled(builder, x, y, yaw, (13.0, 6.4, 6.2), Material.SLATE, pitch=1.1)
    cos, sin = np.cos(yaw), np.sin(yaw)
    tower_x, tower_y = x - 8.2 * cos, y - 8.2 * sin
    ground = height_at(tower_x, tower_y)
    frame = local_frame(tower_x, tower_y, ground, yaw)
    builder.start((tower_x, tower_y, ground))
    builder.box(frame, np.array([-2.1, -2.1, -2.0]), np.array([2.1, 2.1, 12.5]), Material.PLASTER)
    _add_spire(builder, frame, 2.5, 12.3, 20.0)
    return x - 2.0, y - 1.0, 12.0


def _add_spire(builder: MeshBuilder, frame: Floats, half: float, low: float, high: float) -> None:
    ring = [(-half, -half), (half, -half), (half, half), (-half, half)]
    for (ax, ay), (bx, by) in zip(ring, ring[1:] + ring[:1], strict=True):
        tip = (0.0, 0.0, high)
        side = np.array([(ax, ay, low), (bx, by, low), tip, tip])
        builder.quad(to_world(frame, side), Material.SLATE)


def _add_gabled(
    builder: MeshBuilder,
    x: float,
    y: float,
    yaw: float,
    size: tuple[float, float, float],
    roof: Material,
    *,
    pitch: float = 0.8,
) -> None:
    """A house of ``size`` (length, width, height of the eaves) with a gabled roof."""
    length, width, eaves = size
    ground = height_at(x, y)
    frame = local_frame(x, y, ground, yaw)
    builder.start((x, y, ground))
    half_l, half_w = length / 2, width / 2
    ridge = eaves + pitch * half_w
    low, high = np.array([-half_l, -half_w, -2.5]), np.array([half_l, half_w, eaves])
    builder.box(frame, low, high, Material.PLASTER)
    for side in (-1.0, 1.0):
        gable = np.array(
            [
                (side * half_l, -side * half_w, eaves),
                (side * half_l, side * half_w, eaves),
                (side * half_l, 0.0, ridge),
                (side * half_l, 0.0, ridge),
            ]
        )
        builder.quad(to_world(frame, gable), Material.PLASTER)
        over_l, over_w, lift = half_l + 0.45, half_w + 0.5, 0.12
        foot = ridge + lift - pitch * over_w
        slope = np.array(
            [
                (-side * over_l, -side * over_w, foot),
                (side * over_l, -side * over_w, foot),
                (side * over_l, 0.0, ridge + lift),
                (-side * over_l, 0.0, ridge + lift),
            ]
        )
        builder.quad(to_world(frame, slope), roof)
    builder.box(
        frame,
        np.array([half_l * 0.4, half_w * 0.25, eaves]),
        np.array([half_l * 0.4 + 0.8, half_w * 0.25 + 0.7, ridge + 0.9]),
        Material.STONE,
    )


def _add_houses(
    builder: MeshBuilder, rng: np.random.Generator, taken: list[tuple[float, float, float]]
) -> list[tuple[float, float, float]]:
    """Houses along the roads, gable or eaves to the street."""
    placed: list[tuple[float, float, float]] = []
    for _ in range(4000):
        if len(placed) == _NUM_HOUSES:
            break
        road = ROADS[rng.integers(len(ROADS))]
        leg = rng.integers(len(road) - 1)
        along = (road[leg + 1] - road[leg]).astype(float)
        across = np.array([-along[1], along[0]]) / np.hypot(*along) * rng.choice([-1.0, 1.0])
        x, y = road[leg] + rng.random() * along + across * rng.uniform(6.0, 9.0)
        size = (rng.uniform(6.5, 10.5), rng.uniform(4.8, 6.4), rng.uniform(2.8, 5.0))
        reach = 0.5 * float(np.hypot(size[0], size[1])) + 0.6
        on_road = road_distance(np.array([[x, y]], dtype=np.float32))[0]
        if on_road < ROAD_HALF_WIDTH_M + reach * 0.8 or np.hypot(x, y) > 62.0:
            continue
        if any(np.hypot(x - ox, y - oy) < reach + radius for ox, oy, radius in taken + placed):
            continue
        yaw = np.arctan2(along[1], along[0]) + rng.choice([0.0, np.pi / 2]) + rng.normal(0.0, 0.08)
        roof = Material.TILES if rng.random() < 0.8 else Material.SLATE
        _add_gabled(builder, x, y, yaw, size, roof, pitch=rng.uniform(0.65, 0.95))
        placed.append((x, y, reach))
    return placed


def _free_places(
    rng: np.random.Generator,
    taken: list[tuple[float, float, float]],
    *,
    count: int,
    reach: float,
    room: float,
) -> Floats:
    """``count`` random places (N, 2) up to ``reach`` metres out, without occupied ones."""
    places = (reach * rng.uniform(-1.0, 1.0, (count, 2))).astype(np.float32)
    clear = road_distance(places) > ROAD_HALF_WIDTH_M + room
    for x, y, radius in taken:
        clear &= np.hypot(places[:, 0] - x, places[:, 1] - y) > room + radius
    return places[clear]


def _add_boulders(
    builder: MeshBuilder, rng: np.random.Generator, taken: list[tuple[float, float, float]]
) -> None:
    places = _free_places(rng, taken, count=_NUM_BOULDERS, reach=75.0, room=1.0)
    for number, ((x, y), ground) in enumerate(zip(places, height(places), strict=True)):
        size = float(np.exp(rng.normal(-0.5, 0.45)))
        builder.start((x, y, ground))
        centre = np.array([x, y, ground + 0.2 * size])
        builder.blob(centre, size * rng.uniform(0.7, 1.3, 3), 5000 + 10 * number, Material.ROCK)


def _add_trees(
    builder: MeshBuilder, rng: np.random.Generator, taken: list[tuple[float, float, float]]
) -> None:
    """Trees along the edges of fields, and a few anywhere."""
    places = _free_places(rng, taken, count=20 * _NUM_TREES, reach=120.0, room=1.8)
    at_edge = fields(places)[1] < 2.0
    places = places[at_edge | (rng.random(len(places)) < 0.1)][:_NUM_TREES]
    for number, ((x, y), ground) in enumerate(zip(places, height(places), strict=True)):
        builder.start((x, y, ground))
        size = rng.uniform(1.1, 2.5)
        trunk = ground + rng.uniform(0.9, 1.6) * size
        foot, top = (0.18 * size, ground - 1), (0.12 * size, trunk)
        builder.tube((x, y), foot, top, Material.WOOD, sides=8)
        for part in range(int(rng.integers(1, 4))):
            shift = rng.normal(0.0, 0.45 * size, 3) * np.array([1.0, 1.0, 0.5])
            radii = size * rng.uniform(0.75, 1.15, 3) * np.array([1.0, 1.0, 1.15])
            centre = np.array([x, y, trunk + 0.5 * size]) + shift
            builder.blob(centre, radii, 9000 + 50 * number + 10 * part, Material.LEAVES)
