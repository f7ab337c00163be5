from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
from helpers.control_making import FRAME, K1, Flight, bent, displaced, make_flight

from sfm_front.geometry.similarity import Similarities
from sfm_front.georeference.control.control_points import (
    ControlResult,
    NotControlled,
    hold_to_control_points,
)
from sfm_front.georeference.control.options import ControlOptions
from sfm_front.georeference.control.residuals import PointRole
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions
from sfm_front.mapping.position_priors import PositionPriors

# Within this are 90 % of the checkpoints: marks of 0.3 px, points of 5 mm, 2.2 cm a pixel.
CENTIMETRE_M = 0.015
# Of the whole ground, also where no control point is near.
GROUND_M = 0.03


@pytest.fixture(scope="module")
def flight() -> Flight:
    return make_flight()


@pytest.fixture(scope="module")
def bent_model(flight):
    return bent(flight.model)


@pytest.fixture
def rng():
    return np.random.default_rng(1)


def hold(model, points, marks, *, is_metric=False, positions=None):
    options = RobustAdjustmentOptions(num_threads=1)
    return hold_to_control_points(
        model,
        points,
        marks,
        FRAME,
        ControlOptions(),
        options,
        is_metric=is_metric,
        positions=positions,
    )


def ground(model, truth):
    """(N, 3) and (N, 3): the points of the model and where they are in truth."""
    ids = list(truth.point3D_ids())
    return tuple(np.array([m.point3D(i).xyz for i in ids]) for m in (model, truth))


def rms(model, truth):
    """(3,) metres by which the points of the model are off."""
    here, there = ground(model, truth)
    return np.sqrt(((here - there) ** 2).mean(axis=0))


def roles(result, role):
    return {point.name for point in result.points if point.role is role}


def test_a_good_model_is_brought_to_the_ground_to_the_centimetre(flight, rng):
    model = displaced(flight.model)
    result = hold(model, flight.points(rng), flight.marks)
    assert isinstance(result, ControlResult)
    assert roles(result, PointRole.CONTROL) == {f"gcp{i}" for i in range(8)}
    assert (result.control.count, result.checkpoints.count) == (8, 5)
    assert result.sigma_factor == 1
    assert result.checkpoints.ce90_m < 2 * CENTIMETRE_M
    assert result.checkpoints.le90_m < CENTIMETRE_M
    assert rms(model, flight.model).max() < GROUND_M


def test_points_take_the_bend_out_of_a_model_and_mend_its_camera(flight, bent_model, rng):
    # A free fit stays far off.
    here, there = ground(bent_model, flight.model)
    fitted = Similarities.between(here[None], there[None])(here)[0]
    assert np.sqrt(((fitted - there) ** 2).mean(axis=0))[2] > 10 * GROUND_M
    model = displaced(bent_model)
    result = hold(model, flight.points(rng), flight.marks)
    assert rms(model, flight.model).max() < GROUND_M
    assert result.checkpoints.ce90_m < 2 * CENTIMETRE_M
    assert result.checkpoints.le90_m < CENTIMETRE_M
    assert model.camera(1).params[3] == pytest.approx(K1, abs=0.002)
    assert result.error_after_px < result.error_before_px
    # What holds the points in the adjustment is gone again.
    assert model.num_images() == flight.model.num_images()
    assert set(model.point3D_ids()) == set(flight.model.point3D_ids())
    assert model.compute_num_observations() == flight.model.compute_num_observations()


def test_checkpoints_do_not_hold_the_model(flight, rng):
    moved = {f"{i}_check": (0.5, -0.3, 0.4) for i in range(5)}
    points = flight.points(rng, moved=moved)
    model = displaced(flight.model)
    result = hold(model, points, flight.marks)
    assert rms(model, flight.model).max() < GROUND_M
    for residual in result.points:
        if residual.role is PointRole.CHECKPOINT:
            off = (residual.east_m, residual.north_m, residual.up_m)
            assert off == pytest.approx((-0.5, 0.3, -0.4), abs=3 * CENTIMETRE_M)
    assert result.checkpoints.east_rms_m == pytest.approx(0.5, abs=2 * CENTIMETRE_M)
    assert result.checkpoints.ce90_m == pytest.approx(np.hypot(0.5, 0.3), abs=2 * CENTIMETRE_M)
    assert result.checkpoints.le90_m == pytest.approx(0.4, abs=2 * CENTIMETRE_M)


@pytest.mark.parametrize("shift", [(0.3, 0.0, 0.2), (8.0, 3.0, 0.0)])
def test_a_wrong_point_is_named_even_in_a_bent_model(flight, bent_model, rng, shift):
    model = displaced(bent_model)
    result = hold(model, flight.points(rng, moved={"gcp4": shift}), flight.marks)
    assert roles(result, PointRole.LEFT_OUT) == {"gcp4"}
    wrong = next(point for point in result.points if point.name == "gcp4")
    assert wrong.horizontal_m == pytest.approx(np.hypot(*shift[:2]), abs=2 * CENTIMETRE_M)
    assert "gcp4 (left out)" in str(wrong)
    assert rms(model, flight.model).max() < GROUND_M


def test_a_wrong_mark_is_named(flight, rng):
    index = next(i for i, mark in enumerate(flight.marks) if mark.point == "gcp2")
    wrong = flight.marks[index]
    marks = list(flight.marks)
    marks[index] = replace(wrong, x=wrong.x + 30)
    result = hold(displaced(flight.model), flight.points(rng), marks)
    bad = [(p.name, m.photo) for p in result.points for m in p.marks if not m.agrees]
    assert bad == [("gcp2", wrong.photo)]
    point = next(point for point in result.points if point.name == "gcp2")
    assert f"mark in {wrong.photo} off by 30" in str(point)
    assert point.role is PointRole.CONTROL
    assert result.checkpoints.le90_m < CENTIMETRE_M


def test_points_without_heights_hold_the_model_horizontally(flight, bent_model, rng):
    model = displaced(bent_model)
    result = hold(model, flight.points(rng, with_heights=False), flight.marks)
    assert all(point.up_m is None for point in result.points)
    assert result.checkpoints.le90_m is None
    assert result.checkpoints.ce90_m < 2 * CENTIMETRE_M
    assert rms(model, flight.model)[:2].max() < 2 * GROUND_M


def test_without_heights_a_metric_model_keeps_its_own(flight, rng):
    model = copy.deepcopy(flight.model)
    result = hold(model, flight.points(rng, with_heights=False), flight.marks, is_metric=True)
    assert result.checkpoints.ce90_m < 2 * CENTIMETRE_M
    here, there = ground(model, flight.model)
    assert np.abs((here - there)[:, 2]).mean() < 0.2


def test_points_that_are_less_exact_than_stated_say_so(flight, rng):
    points = flight.points(rng, sigma_m=0.5)
    exact = [
        replace(p, position=replace(p.position, horizontal_sigma_m=0.01, vertical_sigma_m=0.01))
        for p in points
    ]
    model = displaced(flight.model)
    result = hold(model, exact, flight.marks)
    assert 10 < result.sigma_factor < 100
    # The photos are believed: the model is not bent to fit.
    here, there = ground(model, flight.model)
    fitted = Similarities.between(here[None], there[None])(here)[0]
    assert np.sqrt(((fitted - there) ** 2).mean(axis=0)).max() < 3 * GROUND_M


def test_a_model_that_points_cannot_hold_stays_as_it_was(flight, rng):
    points = flight.points(rng)
    model = displaced(flight.model)
    before = {i: model.point3D(i).xyz.copy() for i in model.point3D_ids()}
    few = hold(model, points, [m for m in flight.marks if m.point in ("gcp0", "gcp1", "0_check")])
    assert isinstance(few, NotControlled)
    assert "2 control points" in str(few)
    assert "at least 3" in str(few)
    on_line = ("gcp5", "gcp4", "gcp6")
    flat = [
        p if p.name not in on_line else replace(p, position=replace(p.position, altitude_m=300.0))
        for p in points
    ]
    line = hold(model, flat, [m for m in flight.marks if m.point in on_line])
    assert isinstance(line, NotControlled)
    assert "on a line" in str(line)
    assert all((model.point3D(i).xyz == xyz).all() for i, xyz in before.items())


def test_photos_that_are_not_in_the_model_are_passed_over(flight, rng):
    marks = [replace(m, photo="elsewhere.jpg") if m.point == "gcp4" else m for m in flight.marks]
    result = hold(displaced(flight.model), flight.points(rng), marks)
    point = next(point for point in result.points if point.name == "gcp4")
    assert point.role is PointRole.NOT_MEASURED
    assert point.east_m is None
    assert result.control.count == 7


# Control points in one corner only, the rest is held by positions: of 3 cm, all off by metres.
CORNER, CORNER_SIGMA_M = ("gcp0", "gcp5", "0_check"), 0.02
POSITION_SIGMA_M, OFF_M = 0.03, (1.5, -2.0, 3.0)


def positions_of(model, rng, *, spoilt=0.0):
    """Of each photo, as a receiver has them; ``spoilt`` by metres that grow to the east."""
    sigmas = np.full(3, POSITION_SIGMA_M)
    places = {}
    for image_id in model.reg_image_ids():
        centre = model.image(image_id).projection_center()
        bend = spoilt * np.array([0, 0, (centre[0] / 14) ** 2])
        places[image_id] = centre + OFF_M + bend + rng.normal(0, sigmas)
    return PositionPriors(places, dict.fromkeys(places, sigmas))


def in_corner(points):
    return [
        replace(p, is_checkpoint=p.name not in CORNER)
        for p in points
        if p.name in CORNER or p.is_checkpoint
    ]


def test_positions_hold_a_model_where_there_are_no_points_and_points_say_where_it_is(
    flight, bent_model, rng
):
    points = in_corner(flight.points(rng, sigma_m=CORNER_SIGMA_M))
    alone = copy.deepcopy(bent_model)
    assert hold(alone, points, flight.marks).num_positions == 0
    both = copy.deepcopy(bent_model)
    positions = positions_of(flight.model, rng)
    result = hold(both, points, flight.marks, is_metric=True, positions=positions)
    assert result.num_positions == len(positions.positions)
    # The checkpoints' own errors are among theirs.
    assert rms(both, flight.model)[2] < rms(alone, flight.model)[2] / 2
    assert rms(both, flight.model).max() < 2 * CORNER_SIGMA_M
    # The points are not pulled away by positions that are off by metres.
    for point in result.points:
        if point.role is PointRole.CONTROL:
            off = (point.east_m, point.north_m, point.up_m)
            assert np.abs(off).max() < 3 * CORNER_SIGMA_M


def test_positions_that_contradict_the_photos_are_left_out(flight, bent_model, rng):
    points = in_corner(flight.points(rng, sigma_m=CORNER_SIGMA_M))
    spoilt = positions_of(flight.model, rng, spoilt=2.0)
    alone, both = copy.deepcopy(bent_model), copy.deepcopy(bent_model)
    hold(alone, points, flight.marks, is_metric=True)
    result = hold(both, points, flight.marks, is_metric=True, positions=spoilt)
    assert result.num_positions == 0
    assert np.abs(ground(both, alone)[0] - ground(both, alone)[1]).max() < 1e-9


def test_positions_of_photos_that_are_not_in_the_model_are_passed_over(flight, bent_model, rng):
    positions = positions_of(flight.model, rng)
    strange = PositionPriors(
        {image_id + 1000: place for image_id, place in positions.positions.items()},
        {image_id + 1000: sigmas for image_id, sigmas in positions.sigmas.items()},
    )
    model = copy.deepcopy(bent_model)
    result = hold(model, flight.points(rng), flight.marks, is_metric=True, positions=strange)
    assert result.num_positions == 0
