"""What is known of an output → what is drawn, as arrays in the scene's coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sfm_front.live_page import palette
from sfm_front.live_page.arrangement import Arrangement, Placement
from sfm_front.live_page.follower import Outcome, Seen
from sfm_front.live_page.model_shapes import ModelShape
from sfm_front.reports.story import PhotoState
from sfm_front.types import Float64Array, Uint8Array
from sfm_front.viewers.model_drawing import frustum_size

MOST_POINTS = 200_000
"""More would make a browser slow."""

FRUSTUM_VERTICES = np.array(
    [[0.0, 0, 0], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], np.float64
)
"""A pyramid: its apex at the camera, its base in front; each camera's size stretches it."""

_EDGES = np.array([[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]])

# Where a frustum is widest in sight, as a share of its depth.
_MIDDLE = 0.7

# Room beside the points for what is written on the ground.
_GROUND_MARGIN = 0.05

# Points are thinned in this order, so that a cloud that grows does not flicker.
_SHUFFLE_SEED = 0


@dataclass(frozen=True, slots=True, eq=False)
class Cameras:
    """K cameras: ``names``; ``models`` (K,) places of their models; ``centres`` (K, 3);
    ``rotations`` (K, 3, 3) from camera to scene; ``sizes`` (K, 3) half width, half height and depth
    of frusta; ``colors`` (K, 3) uint8 by state."""

    names: Sequence[str]
    models: Sequence[int]
    centres: Float64Array
    rotations: Float64Array
    sizes: Float64Array
    colors: Uint8Array

    def index(self, name: str) -> int | None:
        """Where a photo is among them; None if it is in no model."""
        try:
            return self.names.index(name)
        except ValueError:
            return None

    def along(self, start: Float64Array, direction: Float64Array) -> int | None:
        """The first camera whose frustum a ray meets, or passes by closely; None without any.

        ``start``, ``direction`` (3,), of length 1.
        """
        middles = self.centres + (_MIDDLE * self.sizes[:, 2:]) * self.rotations[:, :, 2]
        ahead = (middles - start) @ direction
        aside = np.linalg.norm(middles - start - ahead[:, None] * direction, axis=1)
        reach = np.linalg.norm(self.sizes * (1.0, 1.0, 0.5), axis=1)
        met = np.flatnonzero((aside < reach) & (ahead > 0))
        return int(met[np.argmin(ahead[met])]) if len(met) else None

    def segments(self) -> Float64Array:
        """(8 K, 2, 3): the edges of their frusta."""
        corners = FRUSTUM_VERTICES[None] * self.sizes[:, None]
        vertices = corners @ self.rotations.transpose(0, 2, 1) + self.centres[:, None]
        segments: Float64Array = vertices[:, _EDGES].reshape(-1, 2, 3)
        return segments


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """Of models in metres: ``low`` and ``high`` (3,) of the ground's box in the scene, and how long
    a metre is in it."""

    low: Float64Array
    high: Float64Array
    metre: float

    def corners(self) -> Float64Array:
        """(4, 3) at its height, and a little outside."""
        margin = _GROUND_MARGIN * float((self.high - self.low)[:2].max())
        (west, south), (east, north) = self.low[:2] - margin, self.high[:2] + margin
        floor = self.low[2]
        return np.array([[x, y, floor] for x in (west, east) for y in (south, north)])


@dataclass(frozen=True, slots=True, eq=False)
class Scenery:
    """``points`` (N, 3), ``colors`` (N, 3) uint8; ``point_size`` in the scene. For each model its
    ``model_ids``, the session's, and ``tops``, a place above it. ``newest``: its camera. ``links``
    (L, 2, 3): from the newest photo to those that it matches, ``proposals``: to others that
    retrieval named; ``weak_links``: of photos that few others hold; ``all_links``: every verified
    pair. ``gaps`` (G, 3): cameras whose photos match others that wait, with ``gap_counts``: how
    many."""

    cameras: Cameras
    points: Float64Array
    colors: Uint8Array
    point_size: float
    model_ids: Sequence[int]
    tops: Sequence[Float64Array]
    ground: Ground | None
    newest: int | None
    links: Float64Array
    proposals: Float64Array
    weak_links: Float64Array
    all_links: Float64Array
    gaps: Float64Array
    gap_counts: Sequence[int]


class SceneMaker:
    """Makes the scenery of what is seen, at the same place each time."""

    def __init__(self) -> None:
        self._arrangement = Arrangement()

    def make(self, seen: Seen) -> Scenery:
        """Everything there is to be drawn."""
        placements = self._arrangement.place(seen.models)
        cameras = _cameras(seen, placements)
        at = {name: place for place, name in enumerate(cameras.names)}
        points, colors = _points(seen.models, placements)
        newest = seen.newest
        newest_at = at.get(newest.name) if newest is not None else None
        gaps = _gaps(seen, at)
        return Scenery(
            cameras=cameras,
            points=points,
            colors=colors,
            point_size=_point_size(len(points)),
            model_ids=[shape.model_id for shape in seen.models],
            tops=[
                _top(placement.points(np.concatenate([shape.centres, shape.points])))
                for shape, placement in zip(seen.models, placements, strict=True)
            ],
            ground=_ground(seen.models, placements),
            newest=newest_at,
            links=_segments(cameras, newest_at, [] if newest is None else newest.links, at),
            proposals=_segments(
                cameras,
                newest_at,
                [] if newest is None else [n for n in newest.similar if n not in newest.links],
                at,
            ),
            weak_links=_joined_segments(cameras, seen.weak, at),
            all_links=_joined_segments(cameras, list(seen.outcomes.values()), at),
            gaps=cameras.centres[list(gaps)].reshape(-1, 3),
            gap_counts=list(gaps.values()),
        )


def _cameras(seen: Seen, placements: Sequence[Placement]) -> Cameras:
    names: list[str] = []
    models: list[int] = []
    centres, rotations, sizes = [np.zeros((0, 3))], [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    lengths = [
        placement.scale * frustum_size(shape.points, shape.centres)
        for shape, placement in zip(seen.models, placements, strict=True)
    ]
    for place, (shape, placement) in enumerate(zip(seen.models, placements, strict=True)):
        names += shape.names
        models += [place] * len(shape.names)
        centres.append(placement.points(shape.centres))
        rotations.append(placement.rotations(shape.rotations))
        sizes.append(lengths[place] * shape.sizes)
    for photo in seen.fresh:
        model = seen.outcomes[photo.name].model
        if photo.pose is None or model is None:
            continue
        world_from_cam = photo.pose.cam_from_world.inverse()
        names.append(photo.name)
        models.append(model)
        centres.append(placements[model].points(world_from_cam.translation[None]))
        rotations.append(placements[model].rotations(world_from_cam.rotation.matrix()[None]))
        sizes.append(lengths[model] * photo.pose.size[None])
    colors = [
        palette.NEWEST
        if seen.newest is not None and name == seen.newest.name
        else palette.WEAK
        if seen.outcomes[name].is_weak
        else palette.of_model(place)
        for name, place in zip(names, models, strict=True)
    ]
    return Cameras(
        names,
        models,
        np.concatenate(centres),
        np.concatenate(rotations),
        np.concatenate(sizes),
        np.array(colors, np.uint8).reshape(-1, 3),
    )


def _points(
    shapes: Sequence[ModelShape], placements: Sequence[Placement]
) -> tuple[Float64Array, Uint8Array]:
    points, colors = [np.zeros((0, 3))], [np.zeros((0, 3), np.uint8)]
    for shape, placement in zip(shapes, placements, strict=True):
        points.append(placement.points(shape.points))
        colors.append(shape.colors)
    xyz, rgb = np.concatenate(points), np.concatenate(colors)
    if len(xyz) > MOST_POINTS:
        kept = np.random.default_rng(_SHUFFLE_SEED).permutation(len(xyz))[:MOST_POINTS]
        xyz, rgb = xyz[kept], rgb[kept]
    if not rgb.any():  # A model of another program, without colours.
        rgb = np.full_like(rgb, 160)
    return xyz, rgb


def _point_size(count: int) -> float:
    """Such that clouds look equally dense."""
    return float(np.clip(1.9 / np.sqrt(max(count, 1)), 0.007, 0.035))


def _top(points: Float64Array) -> Float64Array:
    low, high = np.percentile(points, (2, 98), axis=0)
    return np.array([*(low + high)[:2] / 2, high[2] + 0.05 * float(np.linalg.norm(high - low))])


def _ground(shapes: Sequence[ModelShape], placements: Sequence[Placement]) -> Ground | None:
    if not shapes or not shapes[0].is_enu or not len(shapes[0].points):
        return None
    points = placements[0].points(shapes[0].points)
    low, high = np.percentile(points, (2, 98), axis=0)
    return Ground(low, high, placements[0].scale)


def _segments(
    cameras: Cameras, start: int | None, names: Sequence[str] | dict[str, int], at: dict[str, int]
) -> Float64Array:
    ends = [at[name] for name in names if name in at]
    if start is None or not ends:
        return np.zeros((0, 2, 3))
    firsts = np.repeat(cameras.centres[start][None], len(ends), axis=0)
    return np.stack([firsts, cameras.centres[ends]], axis=1)


def _joined_segments(
    cameras: Cameras, outcomes: Sequence[Outcome], at: dict[str, int]
) -> Float64Array:
    pairs = {
        (min(at[one.photo.name], at[name]), max(at[one.photo.name], at[name]))
        for one in outcomes
        if one.photo.name in at
        for name in one.photo.links
        if name in at
    }
    # Photos of different models see the same, but nobody knows where.
    ends = [pair for pair in sorted(pairs) if cameras.models[pair[0]] == cameras.models[pair[1]]]
    return cameras.centres[np.array(ends, np.int64).reshape(-1, 2)]


def _gaps(seen: Seen, at: dict[str, int]) -> dict[int, int]:
    """Cameras whose photos match best with photos that wait, and how many of those."""
    counts: dict[int, int] = {}
    for outcome in seen.named(PhotoState.WAITING):
        links = {at[name]: count for name, count in outcome.photo.links.items() if name in at}
        if links:
            best = max(links, key=lambda place: links[place])
            counts[best] = counts.get(best, 0) + 1
    return counts
