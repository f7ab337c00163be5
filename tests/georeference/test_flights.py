"""Heights of one flight that are off by one amount."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.flight_making import CONSUMER_SIGMAS_M, flight, strips

from sfm_front.georeference.alignment import align

RTK_SIGMAS_M = (0.05, 0.05, 0.1)
LABELS = (np.arange(40) >= 24).astype(np.int64)


def found_offsets(rise_m, sigmas_m, seed, order=None, labels=LABELS):
    noise_m = (1, 1, 2) if sigmas_m == CONSUMER_SIGMAS_M else sigmas_m
    true = strips(40) if order is None else strips(40)[order]
    made = flight(true, seed, noise_m)
    made.enu[labels == 1, 2] += rise_m
    found = align(made.centres, made.fixes(sigmas_m, labels), made.cam_from_model)
    assert found is not None
    worst = np.linalg.norm(found.enu_from_model * made.centres - made.true, axis=1).max()
    return found, worst


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    # Four standard deviations of the difference between a flight and another beside it.
    ("sigmas_m", "near_m"),
    [(CONSUMER_SIGMAS_M, 5.0), (RTK_SIGMAS_M, 0.25)],
)
@pytest.mark.parametrize("mixed", [False, True])
def test_a_flight_15_m_up_is_told_and_taken_off(sigmas_m, near_m, mixed, seed):
    order = np.random.default_rng(seed).permutation(40) if mixed else None
    found, worst = found_offsets(15.0, sigmas_m, seed, order)
    assert found.height_offsets == {1: pytest.approx(15.0, abs=near_m)}
    assert found.inliers.all()
    assert worst < 1.5 * near_m
    assert np.abs(np.nanmean(found.residuals[LABELS == 1, 2])) < near_m


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sigmas_m", [CONSUMER_SIGMAS_M, RTK_SIGMAS_M])
def test_flights_of_one_height_get_no_offset(sigmas_m, seed):
    found, _ = found_offsets(0.0, sigmas_m, seed)
    assert found.height_offsets == {}


def test_one_flight_has_nothing_to_be_off_against():
    found, _ = found_offsets(0.0, CONSUMER_SIGMAS_M, 0, labels=np.zeros(40, np.int64))
    assert found.height_offsets == {}


def test_flights_without_heights_get_no_offset():
    made = flight(strips(40), seed=1)
    made.enu[LABELS == 1, 2] = np.nan
    found = align(made.centres, made.fixes(flights=LABELS), made.cam_from_model)
    assert found is not None
    assert found.height_offsets == {}
