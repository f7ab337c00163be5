"""Which positions of a set of photos cannot be: each by itself may look as good as any."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from sfm_front.types import Float64Array, GeoPosition

# Two photos of one place are nothing unusual.
_MOST_AT_ONE_PLACE = 2
# Who climbs on the spot is not standing still.
_CLIMB_M = 5.0
# Groups of photos with so much space between them and all others, as a multiple of the median
# distance from the middle, and not below or above these bounds, are far away.
_GAP_PER_SPREAD = 10.0
_SMALLEST_GAP_M, _LARGEST_GAP_M = 1e3, 5e4
# A group that is far away is left out if it has no more photos than this, or than this share.
# Larger ones may be a second site; whether they fit their model is seen there.
_FEW, _FEW_SHARE = 2, 0.02
# As is the rest, if it is not so many times as large: nobody knows who is right.
_MANY_TIMES = 4
_METRES_PER_DEGREE = 111_320.0

_Mask = NDArray[np.bool_]


class LeftOut(Enum):
    """Why a position is not used."""

    NO_FIX = "latitude and longitude are 0"
    NO_ALTITUDE = "no altitude, which most others have"
    FROZEN = "the very same numbers as other photos"
    FAR_AWAY = "far from all others"


@dataclass(frozen=True, slots=True)
class CheckedPositions:
    """By image id: positions that can be used, and why the others cannot."""

    usable: dict[int, GeoPosition]
    left_out: dict[int, LeftOut]


def check_positions(positions: Mapping[int, GeoPosition]) -> CheckedPositions:
    """Sort out what cannot be, by these rules one after the other. In order of capture.

    - Without a fix: receivers write latitude and longitude 0.
    - Without altitude, or with one of exactly 0, where more than half of the others have one.
      Where most have none, an altitude of 0 means that it is not known, and all stay.
    - Frozen: a receiver that lost its fix repeats the last one. Latitude and longitude are the same
      to the last digit in three photos or more, and in more than twice as many as usual, at about
      the same altitude. All of them are left out, for none says which was taken there. What is
      usual is the lower median over the places: 1 for a flight, 3 or 5 where exposures are
      bracketed at each stop, all of them for a series from a tripod; these are kept. So are those
      that are as exact as they say even so: with the median step between photos, the way that was
      not seen is shorter than their standard deviation.
    - Far away: a few photos in a group by itself (two at most, or 2 %), with a gap to all others
      of more than ten times the median distance from the middle, though not below 1 km, and 50 km
      are always enough. A corridor of any length has no such gap, and a second site more photos.

    In time linear in the number of photos, and fit to be called after each.
    """
    ids = list(positions)
    table = np.column_stack(
        [
            np.array([p.longitude_deg for p in positions.values()], np.float64),
            np.array([p.latitude_deg for p in positions.values()], np.float64),
            np.array([p.altitude_m or np.nan for p in positions.values()], np.float64),
            np.array([p.horizontal_sigma_m or 0.0 for p in positions.values()], np.float64),
        ]
    )
    left_out: dict[int, LeftOut] = {}
    rest = np.arange(len(ids))
    for reason, rule in (
        (LeftOut.NO_FIX, _without_fix),
        (LeftOut.NO_ALTITUDE, _without_altitude),
        (LeftOut.FROZEN, _frozen),
        (LeftOut.FAR_AWAY, _far_away),
    ):
        found = rule(table[rest])
        left_out |= {ids[i]: reason for i in rest[found].tolist()}
        rest = rest[~found]
    usable = {ids[i]: _known(positions[ids[i]]) for i in rest.tolist()}
    return CheckedPositions(usable, left_out)


def _known(position: GeoPosition) -> GeoPosition:
    """Without an altitude of 0: where it is left, most others have none either."""
    return replace(position, altitude_m=None) if position.altitude_m == 0 else position


# Each takes (N, 4) longitude and latitude in degrees, altitude in metres, nan where it is not known
# or 0, and horizontal standard deviation in metres, 0 where it is not known; and returns an (N,)
# mask of those to be left out.


def _without_fix(table: Float64Array) -> _Mask:
    nowhere: _Mask = (table[:, :2] == 0).all(axis=1)
    return nowhere


def _without_altitude(table: Float64Array) -> _Mask:
    without: _Mask = np.isnan(table[:, 2])
    return without if 2 * without.sum() < len(table) else np.zeros(len(table), np.bool_)


def _frozen(table: Float64Array) -> _Mask:
    frozen = np.zeros(len(table), np.bool_)
    _, place_of, num_at = np.unique(table[:, :2] @ (1, 1j), return_inverse=True, return_counts=True)
    if len(num_at) < 2:
        return frozen
    usual = np.sort(num_at)[(len(num_at) - 1) // 2]
    steps_m = np.linalg.norm(np.diff(_metres(table), axis=0), axis=1)
    step_m = np.median(steps_m[np.diff(place_of) != 0])
    for place in np.flatnonzero(num_at > max(_MOST_AT_ONE_PLACE, 2 * usual)):
        there = place_of == place
        altitudes, sigmas = table[there, 2], table[there, 3]
        unseen_m = (num_at[place] - 1) * step_m
        if not np.ptp(altitudes) > _CLIMB_M and unseen_m > sigmas.max():
            frozen |= there
    return frozen


def _far_away(table: Float64Array) -> _Mask:
    if len(table) <= _MANY_TIMES:
        return np.zeros(len(table), np.bool_)
    xy = _metres(table)
    spread = float(np.median(np.hypot(xy[:, 0], xy[:, 1])))
    gap = min(max(_GAP_PER_SPREAD * spread, _SMALLEST_GAP_M), _LARGEST_GAP_M)
    group_of = _groups(np.floor(xy / gap))
    sizes = np.bincount(group_of)
    few = max(_FEW, _FEW_SHARE * len(table))
    is_far: _Mask = (sizes <= few) & (sizes * _MANY_TIMES <= sizes.max())
    return is_far[group_of]


def _metres(table: Float64Array) -> Float64Array:
    """(N, 2) roughly east and north of the middle, the median of each."""
    degrees = table[:, :2].copy()
    # Longitudes from one of them, so that the date line is no gap.
    first = degrees[0, 0]
    degrees[:, 0] = first + (degrees[:, 0] - first + 180.0) % 360.0 - 180.0
    degrees -= np.median(degrees, axis=0)
    east_per_degree = np.cos(np.radians(np.median(table[:, 1]))) * _METRES_PER_DEGREE
    return np.asarray(degrees * (east_per_degree, _METRES_PER_DEGREE))


def _groups(cells: Float64Array) -> NDArray[np.int64]:
    """(N, 2) whole numbers, cells of a grid → (N,) which group each is in: cells that touch are in
    the same."""
    occupied, cell_of = np.unique(cells @ (1, 1j), return_inverse=True)
    number = {cell: i for i, cell in enumerate(occupied.tolist())}
    around = [complex(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    group = np.full(len(occupied), -1)
    for start in range(len(occupied)):
        if group[start] >= 0:
            continue
        group[start] = start
        reached = deque([occupied[start].item()])
        while reached:
            cell = reached.popleft()
            for step in around:
                other = number.get(cell + step)
                if other is not None and group[other] < 0:
                    group[other] = start
                    reached.append(cell + step)
    return np.asarray(group[cell_of])
