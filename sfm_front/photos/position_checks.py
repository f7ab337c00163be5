"""Which positions of a set of photos cannot be: each by itself may look as good as any."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from sfm_front.types import Float64Array, GeoPosition

# A set of the very same numbers that is not larger is taken as it is: two photos of one place,
# or a bracket of exposures, are nothing unusual.
_LEAST_FROZEN = 3
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
    """Sort out what cannot be by these rules, one after the other.

    - Without a fix: receivers write latitude and longitude 0.
    - Without altitude, or with one of exactly 0, where more than half of the others have one.
      Where most have none, an altitude of 0 means that it is not known, and all stay.
    - Frozen: a receiver that lost its fix repeats the last one. Latitude, longitude and altitude
      are the same to the last digit in three photos or more, and in more than twice as many as
      usual. What is usual is the lower median over the places: 1 for a flight, 3 or 5 where
      exposures are bracketed at each stop, all of them for a series from a tripod, which is kept.
      All photos of a frozen fix are left out, for none says which was taken where.
    - Far away: a few photos in a group by itself (two at most, or 2 %), with a gap to all others
      of more than ten times the median distance from the middle, though not below 1 km, and 50 km
      are always enough. A corridor of any length has no such gap, and a second site more photos.

    In time linear in the number of photos, and fit to be called after each.
    """
    left_out = {i: LeftOut.NO_FIX for i, position in positions.items() if not position.is_fix}
    usable = {i: position for i, position in positions.items() if position.is_fix}
    for reason, found in (
        (LeftOut.NO_ALTITUDE, _without_altitude),
        (LeftOut.FROZEN, _frozen),
        (LeftOut.FAR_AWAY, _far_away),
    ):
        for image_id in found(usable):
            left_out[image_id] = reason
            del usable[image_id]
    # Where these are left, most others have none either.
    usable = {
        i: replace(position, altitude_m=None) if position.altitude_m == 0 else position
        for i, position in usable.items()
    }
    return CheckedPositions(usable, left_out)


def _without_altitude(positions: Mapping[int, GeoPosition]) -> list[int]:
    # Not known, or 0.
    without = [i for i, position in positions.items() if not position.altitude_m]
    return without if 2 * len(without) < len(positions) else []


def _frozen(positions: Mapping[int, GeoPosition]) -> list[int]:
    if len(positions) < _LEAST_FROZEN:
        return []
    place_of = {
        i: (position.latitude_deg, position.longitude_deg, position.altitude_m)
        for i, position in positions.items()
    }
    photos_at = Counter(place_of.values())
    usual = sorted(photos_at.values())[(len(photos_at) - 1) // 2]
    most = max(_LEAST_FROZEN - 1, 2 * usual)
    return [i for i, place in place_of.items() if photos_at[place] > most]


def _far_away(positions: Mapping[int, GeoPosition]) -> list[int]:
    if len(positions) <= _MANY_TIMES:
        return []
    xy = _metres(positions)
    spread = float(np.median(np.linalg.norm(xy, axis=1)))
    gap = min(max(_GAP_PER_SPREAD * spread, _SMALLEST_GAP_M), _LARGEST_GAP_M)
    group_of = _groups(np.floor(xy / gap).astype(np.int64))
    sizes = np.bincount(group_of)
    few = max(_FEW, _FEW_SHARE * len(positions))
    is_far = (sizes <= few) & (sizes * _MANY_TIMES <= sizes.max())
    return [i for i, group in zip(positions, group_of, strict=True) if is_far[group]]


def _metres(positions: Mapping[int, GeoPosition]) -> Float64Array:
    """(N, 2) roughly east and north of the middle, the median of each."""
    degrees = np.array([(p.longitude_deg, p.latitude_deg) for p in positions.values()])
    # Longitudes from one of them, so that the date line is no gap.
    first = degrees[0, 0]
    degrees[:, 0] = first + (degrees[:, 0] - first + 180.0) % 360.0 - 180.0
    middle = np.median(degrees, axis=0)
    east_per_degree = np.cos(np.radians(middle[1])) * _METRES_PER_DEGREE
    return np.asarray((degrees - middle) * (east_per_degree, _METRES_PER_DEGREE))


def _groups(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N, 2) cells of a grid → (N,) which group each is in: cells that touch are in the same."""
    occupied, cell_of = np.unique(cells, axis=0, return_inverse=True)
    number = {(x, y): i for i, (x, y) in enumerate(occupied.tolist())}
    group = np.full(len(occupied), -1)
    for start in range(len(occupied)):
        if group[start] >= 0:
            continue
        group[start] = start
        reached = deque([start])
        while reached:
            x, y = occupied[reached.popleft()].tolist()
            for neighbor in ((x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)):
                other = number.get(neighbor)
                if other is not None and group[other] < 0:
                    group[other] = start
                    reached.append(other)
    return np.asarray(group[cell_of.ravel()])
