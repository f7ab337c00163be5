"""Choose a viewpoint for a model: oblique, from behind and above its cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sfm_front.types import Float64Array

VERTICAL_FIELD_OF_VIEW_DEG = 45.0

#: Unit vectors agree if their mean is longer than this. Projected onto the horizon, a camera's
#: forward or its top always is, so that the search for a heading ends.
_AGREEMENT = 0.4
#: Extents below this ratio to the next larger one are flat: the third of a plane, the second of a
#: line.
_FLAT = 0.25
_AZIMUTH_DEG = 28.0
_ELEVATION_DEG = 30.0
#: The fraction of the picture that the scene may fill.
_FILL = 0.95
#: Projected points outside these percentiles may lie outside the picture.
_FRAME_PERCENTILES = (2.0, 98.0)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A virtual camera in world coordinates: it stands at ``eye``, looks at ``target``, and
    ``up`` points upwards in its picture. Each (3,) float64; ``up`` has length 1."""

    eye: Float64Array
    target: Float64Array
    up: Float64Array


def choose_view(
    points: Float64Array,
    camera_points: Float64Array,
    world_from_cam: Float64Array,
    centres: Float64Array,
    aspect: float,
    *,
    azimuth_deg: float = _AZIMUTH_DEG,
    elevation_deg: float = _ELEVATION_DEG,
    up: Float64Array | None = None,
) -> View:
    """A view of the whole scene with its cameras.

    ``points`` (N, 3) are the model's; ``camera_points`` (M, 3) are the corners of the drawn frusta,
    all of which stay inside; ``world_from_cam`` (K, 3, 3) are rotations in COLMAP's convention
    (x right, y down, z forward) and ``centres`` (K, 3) the projection centres, K at least 1;
    ``aspect`` is width over height. ``elevation_deg`` above the horizon, below 90;
    ``azimuth_deg``: to the right of the cameras' heading, which the view has at 0. ``up`` (3,): by
    default as the cameras tell.
    """
    if up is None:
        up = upward(world_from_cam, centres)
    towards = _viewing_direction(world_from_cam, up, azimuth_deg, elevation_deg)
    right = _unit(np.cross(towards, up))
    view_up = np.cross(right, towards)
    basis = np.stack([right, view_up, -towards])  # world to (right, up, towards the viewer)

    framed = [camera_points @ basis.T]
    if len(points):
        projected = points @ basis.T
        low, high = np.percentile(projected, _FRAME_PERCENTILES, axis=0)
        framed.append(projected[np.all((projected >= low) & (projected <= high), axis=1)])
    target, distance = _fit(np.concatenate(framed), aspect)
    eye = target + np.array([0.0, 0.0, distance])
    return View(eye=eye @ basis, target=target @ basis, up=view_up)


def upward(world_from_cam: Float64Array, centres: Float64Array) -> Float64Array:
    """The world's up direction, estimated from the cameras (unit length).

    People walk, cars drive and drones fly level: if the centres lie in a plane, up is its normal,
    on the side of the pictures' tops and the cameras' backs. Otherwise it is the mean of the
    pictures' upward directions or, if these cancel out (a drone that flies to and fro and looks
    down), the opposite of the mean viewing direction.
    """
    tops, backs = -world_from_cam[:, :, 1], -world_from_cam[:, :, 2]
    offsets = centres - centres.mean(axis=0)
    _, extents, axes = np.linalg.svd(offsets, full_matrices=True)
    normal: Float64Array = axes[2]
    side = float(normal @ (tops + backs).mean(axis=0))
    level = (
        len(centres) >= 4 and extents[2] < _FLAT * extents[1] and extents[1] > _FLAT * extents[0]
    )
    if level and abs(side) > _AGREEMENT:
        return normal if side > 0 else -normal
    choices = (tops.mean(axis=0), backs.mean(axis=0), tops[0])
    return _unit(next(choice for choice in choices if np.linalg.norm(choice) > _AGREEMENT))


def _viewing_direction(
    world_from_cam: Float64Array, up: Float64Array, azimuth_deg: float, elevation_deg: float
) -> Float64Array:
    """From ``elevation_deg`` above the horizon, ``azimuth_deg`` off the cameras' heading.

    The heading is their mean viewing direction. Cameras that look straight down or circle an
    object have none: then it is where the tops of their pictures point, or the first camera's.
    """
    forwards, tops = world_from_cam[:, :, 2], -world_from_cam[:, :, 1]
    choices = [forwards.mean(axis=0), tops.mean(axis=0), forwards[0], tops[0]]
    levelled = [choice - (choice @ up) * up for choice in choices]
    heading = next(flat for flat in levelled if np.linalg.norm(flat) > _AGREEMENT)
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    turned = np.cos(azimuth) * _unit(heading) + np.sin(azimuth) * _unit(np.cross(heading, up))
    direction: Float64Array = np.cos(elevation) * turned - np.sin(elevation) * up
    return direction


def _fit(points: Float64Array, aspect: float) -> tuple[Float64Array, float]:
    """Centre and distance at which ``points`` (N, 3: right, up, towards the viewer) fill the frame.

    The smallest distance for a centre is exact; the centre is moved until the margins are even,
    which takes a few rounds.
    """
    half_height = np.tan(np.radians(VERTICAL_FIELD_OF_VIEW_DEG) / 2) * _FILL
    half = np.array([half_height * aspect, half_height])
    centre: Float64Array = (points.min(axis=0) + points.max(axis=0)) / 2
    for _ in range(8):
        offset, distance = points - centre, _distance(points - centre, half)
        on_screen = offset[:, :2] / np.maximum(distance - offset[:, 2:], 1e-9)
        centre[:2] += (on_screen.min(axis=0) + on_screen.max(axis=0)) / 2 * distance
    return centre, _distance(points - centre, half)


def _distance(offset: Float64Array, half: Float64Array) -> float:
    """The smallest distance at which all of ``offset`` (N, 3) is within ``half``, the tangents of
    the half fields of view."""
    return max(float((np.abs(offset[:, :2]) / half + offset[:, 2:]).max()), 1e-6)


def _unit(vector: Float64Array) -> Float64Array:
    scaled: Float64Array = vector / max(float(np.linalg.norm(vector)), 1e-12)
    return scaled
