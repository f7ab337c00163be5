"""Figures for how well a model and positions agree."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.flight_making import flight, strips, thrown

from sfm_front.georeference.accuracy import bend_of_heights, summarise
from sfm_front.georeference.alignment import align


def summary_of(photos, **fixes):
    found = align(photos.centres, photos.fixes(**fixes), photos.cam_from_model)
    return summarise(found, photos.centres, range(1, len(photos.centres) + 1))


def test_residuals_by_axis_are_those_that_were_planted():
    photos = flight(strips(400), seed=0, noise_m=(1.0, 2.0, 4.0))
    found = summary_of(photos)
    # Four standard deviations of a standard deviation of 400 values: 14 %.
    for axis, sigma in ((found.east, 1.0), (found.north, 2.0), (found.up, 4.0)):
        assert axis.sigma == pytest.approx(sigma, rel=0.14)
        assert axis.rms**2 == pytest.approx(axis.mean**2 + axis.sigma**2)
    # Nine of ten of a normal distribution are within 1.645 standard deviations.
    assert found.le90_m == pytest.approx(1.645 * 4, rel=0.2)
    errors = np.random.default_rng(1).normal(size=(100_000, 2)) * (1, 2)
    ce90 = np.percentile(np.linalg.norm(errors, axis=1), 90)
    assert found.ce90_m == pytest.approx(ce90, rel=0.2)
    assert found.num_used == 400
    assert found.outliers == ()


def test_outliers_are_named_with_their_metres_and_left_out_of_the_rest():
    photos = flight(strips(40), seed=0)
    thrown(photos, np.array([6]), 200.0, 0)
    thrown(photos, np.array([20]), 300.0, 1)
    found = summary_of(photos)
    assert [one.image_id for one in found.outliers] == [21, 7]
    assert [one.metres for one in found.outliers] == pytest.approx([300, 200], abs=6)
    assert found.num_used == 38
    assert found.east.rms < 2


def test_without_heights_there_is_nothing_to_say_of_them():
    photos = flight(strips(40), seed=0)
    photos.enu[:, 2] = np.nan
    found = summary_of(photos)
    assert found.up is None
    assert found.le90_m is None
    assert found.bend is None
    assert found.median_m > 0


def test_a_bend_is_the_range_of_its_curved_part():
    enu = strips(104)
    off_centre = (enu[:, 0] - 50) / 50
    # A paraboloid 3 m deep along the strips, on a tilted plane that is no bend.
    heights = 3 * off_centre**2 + 0.1 * enu[:, 1] - 4
    bend = bend_of_heights(enu, heights)
    assert bend.metres == pytest.approx(3, abs=0.1)
    extent = np.linalg.norm(np.ptp(enu[:, :2], axis=0))
    assert bend.share_of_extent == pytest.approx(3 / extent, rel=0.05)
    flat = bend_of_heights(enu, 0.1 * enu[:, 1] - 4)
    assert flat.metres == pytest.approx(0, abs=1e-9)


def test_a_bend_needs_heights_and_an_extent():
    enu = strips(100)
    assert bend_of_heights(enu[:9], np.ones(9)) is None
    assert bend_of_heights(np.zeros((20, 3)), np.ones(20)) is None
    assert bend_of_heights(enu, np.where(np.arange(100) < 9, 1.0, np.nan)) is None
    # Far larger than the extent: its scale is not known.
    assert bend_of_heights(1e-3 * enu, ((enu[:, 0] - 50) / 50) ** 2) is None


def test_a_bend_along_one_line_is_found():
    enu = np.column_stack([np.linspace(0, 100, 30), np.zeros(30), np.full(30, 60.0)])
    bend = bend_of_heights(enu, 2 * ((enu[:, 0] - 50) / 50) ** 2)
    assert bend.metres == pytest.approx(2, abs=0.05)
