"""How far cameras are from their GPS positions."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.model_building import looking, make_model

from sfm_front.evaluation.gps import gps_residual_m
from sfm_front.types import GeoPosition

EARTH_RADIUS_M = 6378137.0
# The curvature of the Earth over 100 m, and that of its ellipsoid, are below a centimetre.
TOLERANCE_M = 0.01


def at(east_m, north_m, up_m):
    """On the equator, where a degree is as long in both directions within 0.7 %."""
    along_meridian = EARTH_RADIUS_M * (1 - 0.00669438)
    return GeoPosition(
        np.degrees(north_m / along_meridian), 10 + np.degrees(east_m / EARTH_RADIUS_M), up_m
    )


@pytest.fixture
def flight():
    """A grid of 4 × 5 photos, 20 m apart at heights that differ: centres (20, 3) in metres."""
    east, north = np.meshgrid(20.0 * np.arange(4), 20.0 * np.arange(5))
    heights = np.random.default_rng(0).uniform(50, 60, 20)
    return np.column_stack([east.ravel(), north.ravel(), heights])


def model_of(centres):
    return make_model(
        {f"{i}.jpg": looking(centre, [0, 0, -1], [0, 1, 0]) for i, centre in enumerate(centres)}
    )


def test_a_model_in_another_frame_and_scale_fits(flight):
    turned = 0.05 * flight[:, [1, 2, 0]] + [3.0, -2.0, 1.0]
    positions = {f"{i}.jpg": at(*centre) for i, centre in enumerate(flight)}
    assert gps_residual_m(model_of(turned), positions) < TOLERANCE_M


def test_errors_that_no_similarity_explains_remain(flight):
    # Along a row of four neither a shift nor a slope fits them. Heights differ by chance, so that a
    # change of scale can fit a little.
    off = flight + np.outer(np.tile([5.0, -5.0, -5.0, 5.0], 5), [0, 0, 1])
    positions = {f"{i}.jpg": at(*centre) for i, centre in enumerate(off)}
    assert gps_residual_m(model_of(flight), positions) == pytest.approx(5.0, abs=0.1)


def test_positions_that_are_too_few_tell_nothing(flight):
    model = model_of(flight)
    positions = {f"{i}.jpg": at(*flight[i]) for i in (0, 1, 4, 5)}
    assert gps_residual_m(model, positions) < TOLERANCE_M
    assert gps_residual_m(model, dict(list(positions.items())[:3])) is None
    without_height = {name: GeoPosition(p.latitude_deg, 10) for name, p in positions.items()}
    assert gps_residual_m(model, without_height) is None
    assert gps_residual_m(model, {"elsewhere.jpg": at(0, 0, 0)}) is None
