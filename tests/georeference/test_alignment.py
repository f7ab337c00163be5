"""A similarity into ENU from positions with planted errors, and how honest its uncertainty is."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from helpers.flight_making import (
    Flight,
    flight,
    line,
    strips,
    thrown,
    tilt_deg,
    turned_by_quarters,
)

from sfm_front.georeference.alignment import Alignment, align
from sfm_front.georeference.fixes import Fixes

# Four standard deviations of the mean of few photos with noise of 1, 1 and 2 m, at the corner of
# the flight, where the tilt counts most.
NEAR_M = 6.0


def aligned(photos: Flight, **fixes) -> Alignment:
    found = align(photos.centres, photos.fixes(**fixes), photos.cam_from_model)
    assert found is not None
    return found


def worst_m(found: Alignment, photos: Flight) -> float:
    moved = found.enu_from_model * photos.centres
    return float(np.linalg.norm(moved - photos.true, axis=1).max())


def test_exact_positions_yield_the_similarity_itself():
    photos = flight(strips(12), seed=0, noise_m=(0, 0, 0))
    found = aligned(photos)
    assert worst_m(found, photos) < 1e-3
    assert found.inliers.all()
    np.testing.assert_allclose(found.residuals, 0, atol=1e-3)


@pytest.mark.parametrize(("photos", "wrong"), [(8, 1), (20, 1), (20, 10), (30, 10), (75, 10)])
@pytest.mark.parametrize("seed", range(3))
def test_outliers_of_200_m_are_named_and_do_no_harm(photos, wrong, seed):
    made = flight(strips(photos), seed)
    rows = np.random.default_rng(seed).permutation(photos)[:wrong]
    thrown(made, rows, 200.0, seed)
    for attitudes in (made.cam_from_model, None):
        found = align(made.centres, made.fixes(), attitudes)
        assert found is not None
        assert set(np.flatnonzero(~found.inliers)) == set(rows)
        assert worst_m(found, made) < NEAR_M
        distances = np.linalg.norm(found.residuals[rows], axis=1)
        np.testing.assert_allclose(distances, 200, atol=2 * NEAR_M)


def test_a_drifting_receiver_raises_the_floor_and_loses_no_photo():
    made = flight(strips(40), seed=1, drift_m=15.0)
    found = aligned(made, sigmas_m=(1.0, 1.0, 1.0))
    assert found.floor.plane_m >= 4
    assert found.num_inliers >= 36


def test_exact_positions_count_more_than_others():
    made = flight(strips(40), seed=2, noise_m=(0.02, 0.02, 0.02))
    rough = np.arange(40) % 2 == 1
    made.enu[rough] += np.random.default_rng(0).normal(size=(20, 3)) * (5, 5, 10)
    sigmas = np.where(rough[:, None], (5.0, 5.0, 10.0), (0.02, 0.02, 0.02))
    found = align(made.centres, Fixes.of(made.enu, sigmas), made.cam_from_model)
    assert found is not None
    assert worst_m(found, made) < 0.1  # five standard deviations of the exact ones


def test_photos_without_height_take_part():
    made = flight(strips(30), seed=3)
    made.enu[::2, 2] = np.nan
    found = aligned(made)
    assert found.inliers.all()
    assert worst_m(found, made) < NEAR_M
    assert np.isnan(found.residuals[::2, 2]).all()
    assert np.isfinite(found.residuals[:, :2]).all()


def test_without_any_height_level_cameras_tell_the_way_up():
    made = flight(strips(30), seed=3)
    made.enu[:, 2] = np.nan
    turned_by_quarters(made)
    found = aligned(made)
    assert tilt_deg(found.enu_from_model, made) < 3
    moved = found.enu_from_model * made.centres
    np.testing.assert_allclose(moved[:, :2], made.true[:, :2], atol=NEAR_M)


def test_photos_on_a_line_stand_upright_by_their_cameras():
    made = flight(line(12), seed=4)
    found = aligned(made)
    assert tilt_deg(found.enu_from_model, made) < 6
    alone = align(made.centres, made.fixes())
    assert alone is not None
    assert alone.tilt_sigma_deg > 30 > 15 > found.tilt_sigma_deg
    # Everything but the rotation about the line is fixed all the same.
    assert worst_m(alone, made) < NEAR_M


def test_cameras_that_were_held_aslant_do_not_tilt_a_model_that_positions_fix():
    made = flight(strips(40), seed=5, roll_rad=0.6)
    found = aligned(made)
    assert worst_m(found, made) < NEAR_M


@pytest.mark.parametrize("seed", range(3))
def test_heights_that_drift_do_not_tilt_level_cameras(seed):
    made = flight(strips(60), seed)
    turned_by_quarters(made)
    made.enu[:, 2] += np.linspace(0, 100, 60)
    alone = align(made.centres, made.fixes())
    assert alone is not None
    assert tilt_deg(alone.enu_from_model, made) > 8
    assert tilt_deg(aligned(made).enu_from_model, made) < 6


@pytest.mark.parametrize("heights", [True, False])
def test_two_positions_or_one_place_align_nothing(heights):
    made = flight(strips(12), seed=7)
    if not heights:
        made.enu[:, 2] = np.nan
    assert align(made.centres[:2], made.fixes()[np.arange(2)]) is None
    made.enu[:] = made.enu[0]
    assert align(made.centres, made.fixes()) is None
    made.enu[:, 2] += np.arange(12)  # as of a receiver that lost its fix
    assert align(made.centres, made.fixes()) is None


def test_the_same_input_gives_the_same_answer():
    made = flight(strips(30), seed=8)
    thrown(made, np.arange(10), 200.0, 8)
    first, second = aligned(made), aligned(made)
    np.testing.assert_array_equal(first.enu_from_model.matrix(), second.enu_from_model.matrix())
    np.testing.assert_array_equal(first.covariance, second.covariance)


@pytest.mark.parametrize("number", [6, 20])
@pytest.mark.parametrize(("noise_m", "drift_m"), [((3, 3, 6), 0.0), ((0.5, 0.5, 0.5), 4.0)])
def test_the_uncertainty_is_honest(number, noise_m, drift_m):
    """Scale, tilt, heading and places of the cameras are within three standard deviations, whether
    errors are independent or wander; and not a tenth of them, or it would say nothing."""
    runs, within, ratios = 40, np.zeros(4), []
    for seed in range(runs):
        made = flight(strips(number), seed, noise_m, drift_m)
        found = aligned(made)
        wrong = found.enu_from_model * made.enu_from_model.inverse()
        turn = np.degrees(cv2.Rodrigues(wrong.rotation.matrix())[0].ravel())
        off = np.abs(found.enu_from_model * made.centres - made.true)
        sigmas = found.position_sigmas_m(made.centres)
        errors = [
            abs(np.log(wrong.scale)) / found.scale_sigma,
            np.linalg.norm(turn[:2]) / found.tilt_sigma_deg,
            abs(turn[2]) / found.heading_sigma_deg,
            np.median(np.max(off / sigmas, axis=1)),
        ]
        within += np.array(errors) < 3
        ratios.append(errors)
    assert (within >= 0.9 * runs).all(), within
    assert (np.sqrt(np.mean(np.square(ratios), axis=0)) > 0.1).all()


def test_the_uncertainty_shrinks_with_photos_and_grows_away_from_them():
    few, many = flight(strips(6), seed=9), flight(strips(60), seed=9)
    assert aligned(many).scale_sigma < 0.5 * aligned(few).scale_sigma
    found = aligned(many)
    far = many.enu_from_model.inverse() * np.array([[50.0, 30, 60], [1000, 30, 60]])
    near_m, far_m = np.linalg.norm(found.position_sigmas_m(far), axis=1)
    assert far_m > 3 * near_m
