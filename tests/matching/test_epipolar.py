"""Which features meet when poses are known: those in each other's epipolar planes, no others."""

from __future__ import annotations

import numpy as np
import pytest

from sfm_front.matching.epipolar import EpipolarPlanes
from sfm_front.matching.match_mask import MatchMask

BAND_RAD = 0.004
MIN_SINE = 0.05
EDGE_RAD = 1e-6  # of the band: angles are compared in float32
SIDEWAYS, FORWARD, BACK = (1.0, 0.1, 0.0), (0.02, 0.01, 1.0), (0.0, 0.0, -1.0)
BASELINES = pytest.mark.parametrize("baseline", [SIDEWAYS, FORWARD, BACK])


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def looking(rng: np.random.Generator, count: int) -> np.ndarray:
    """Rays of a camera that looks along z, 60 degrees wide."""
    return unit(np.column_stack([rng.uniform(-0.6, 0.6, (count, 2)), np.ones(count)]))


def met(mask: MatchMask, count1: int, count2: int) -> np.ndarray:
    """(N, M): how often features meet."""
    times = np.zeros((count1, count2), int)
    for rows, columns, allowed in mask.blocks:
        ids = np.ix_(mask.order1[rows], mask.order2[columns])
        assert len(np.unique(mask.order1[rows])) == len(mask.order1[rows])
        np.add.at(times, ids, allowed)
    return times


def distances(baseline: np.ndarray, rays1: np.ndarray, rays2: np.ndarray) -> np.ndarray:
    """(N, M) from the definition: the angle around the baseline times the sine of that to it."""
    axis = unit(np.asarray(baseline))
    across1, across2 = (rays - (rays @ axis)[:, None] * axis for rays in (rays1, rays2))
    cosine = unit(across1) @ unit(across2).T
    return np.arccos(np.clip(cosine, -1, 1)) * np.linalg.norm(across2, axis=1)


@BASELINES
@pytest.mark.parametrize("min_sine", [MIN_SINE, 0.3])
def test_just_those_in_the_band_meet_and_only_once(baseline, min_sine):
    rng = np.random.default_rng(0)
    rays1, rays2 = looking(rng, 500), looking(rng, 700)
    planes = EpipolarPlanes(np.array(baseline), rays1, rays2)
    times = met(planes.mask(BAND_RAD, min_sine=min_sine), 500, 700)
    axis = unit(np.array(baseline))
    told = np.ix_(
        *(np.linalg.norm(np.cross(rays, axis), axis=1) > min_sine for rays in (rays1, rays2))
    )
    apart = distances(np.array(baseline), rays1, rays2)[told]
    assert times.max() == 1
    assert times[told][apart < BAND_RAD - EDGE_RAD].all()
    assert not times[told][apart > BAND_RAD + EDGE_RAD].any()
    assert times.sum() == times[told].sum() > 500


@BASELINES
def test_points_lie_in_the_same_plane_of_both_photos(baseline):
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-3, 3, (200, 2)), rng.uniform(5, 9, 200)])
    rays1, rays2 = unit(points), unit(points - baseline)
    planes = EpipolarPlanes(np.array(baseline), rays1, rays2)
    same = np.arange(200, dtype=np.uint32)[:, None].repeat(2, axis=1)
    assert planes.distances_rad(same).max() < 1e-9
    others = same.copy()
    others[:, 1] = np.roll(others[:, 1], 1)
    expected = distances(np.array(baseline), rays1, rays2)[others[:, 0], others[:, 1]]
    np.testing.assert_allclose(planes.distances_rad(others), expected, atol=1e-7)


def test_what_has_no_ray_meets_nothing():
    rng = np.random.default_rng(2)
    rays1, rays2 = looking(rng, 50), looking(rng, 60)
    rays1[3] = rays2[7] = np.nan
    planes = EpipolarPlanes(np.array(SIDEWAYS), rays1, rays2)
    times = met(planes.mask(0.5, min_sine=MIN_SINE), 50, 60)
    assert not times[3].any()
    assert not times[:, 7].any()
    assert times.any()
    assert planes.distances_rad(np.array([[3, 0], [0, 7]], np.uint32)).tolist() == [np.inf] * 2


@pytest.mark.parametrize(("count1", "count2"), [(0, 4), (4, 0), (0, 0)])
def test_photos_without_features_are_fine(count1, count2):
    rng = np.random.default_rng(3)
    planes = EpipolarPlanes(np.array(SIDEWAYS), looking(rng, count1), looking(rng, count2))
    assert met(planes.mask(BAND_RAD, min_sine=MIN_SINE), count1, count2).sum() == 0
