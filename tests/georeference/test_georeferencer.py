"""The frame of a model that grows: found, held, remembered."""

from __future__ import annotations

import json
from datetime import datetime, timedelta

import numpy as np
import pycolmap
import pytest
from helpers.flight_making import Flight, flight, line, strips, thrown

from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.georeferencer import Georeferencer, PhotoPosition
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.types import GeoPosition

SITE = LocalFrame(46.84, -91.99, 300.0)
START = datetime(2024, 5, 1, 12, 0, 0)


def measured(photos: Flight, without_altitude=(), **changes) -> dict[int, PhotoPosition]:
    rows = SITE.to_wgs84(photos.enu)
    return {
        image_id: PhotoPosition(
            position=GeoPosition(
                latitude, longitude, None if image_id in without_altitude else altitude
            ),
            horizontal_sigma_m=5.0,
            vertical_sigma_m=10.0,
            captured_at=START + timedelta(seconds=image_id),
            **changes,
        )
        for image_id, (latitude, longitude, altitude) in enumerate(rows.tolist(), start=1)
    }


def posed(photos: Flight, number=None, moved=None) -> dict[int, pycolmap.Rigid3d]:
    """The first photos of a model, in a frame of its own or moved to another."""
    poses = photos.poses()[:number]
    if moved is not None:
        poses = [moved.transform_camera_world(pose) for pose in poses]
    return dict(enumerate(poses, start=1))


def places_m(found, poses) -> np.ndarray:
    """(N, 3) where a georeference has the cameras of a model, against the site's frame."""
    centres = np.array([pose.inverse().translation for pose in poses.values()])
    return SITE.to_enu(found.frame.to_wgs84(found.alignment.enu_from_model * centres))


@pytest.fixture
def photos() -> Flight:
    return flight(strips(40), seed=0)


def test_a_growing_model_becomes_metric_and_stays_within_what_was_said(photos):
    referencer, states, first = Georeferencer(), [], None
    for number in range(1, 41):
        poses = posed(photos, number)
        found = referencer.update(poses, measured(photos))
        states.append(found.state)
        if found.state is GeoreferenceState.METRIC and first is None:
            first = number, places_m(found, poses), found.alignment
    order = list(GeoreferenceState)
    assert [order.index(state) for state in states] == sorted(order.index(s) for s in states)
    assert states[0] is GeoreferenceState.NONE
    assert GeoreferenceState.PROVISIONAL in states
    number, before, said = first
    assert number < 40 / 3
    after = places_m(found, posed(photos))[:number]
    sigmas = said.position_sigmas_m(photos.centres[:number])
    assert np.all(np.abs(after - before) < 3 * sigmas)
    assert not found.held
    assert np.linalg.norm(after - photos.true[:number], axis=1).max() < 4


def test_the_origin_is_the_first_right_position_with_an_altitude_and_stays(photos):
    thrown(photos, np.array([0]), 200.0, 0)
    referencer = Georeferencer()
    positions = measured(photos, without_altitude={2})
    found = referencer.update(posed(photos, 10), positions)
    position = positions[3].position
    assert found.frame == LocalFrame(
        position.latitude_deg, position.longitude_deg, position.altitude_m
    )
    assert referencer.update(posed(photos), measured(photos)).frame == found.frame


def test_the_frame_of_the_model_does_not_matter(photos):
    referencer = Georeferencer()
    first = referencer.update(posed(photos, 20), measured(photos))
    again = posed(photos, 20, first.alignment.enu_from_model)
    second = referencer.update(again, measured(photos))
    assert not second.held
    np.testing.assert_allclose(second.alignment.enu_from_model.matrix(), np.eye(3, 4), atol=0.02)


@pytest.mark.parametrize("shape", [strips, line])
def test_positions_that_contradict_a_metric_frame_are_named_and_not_taken(shape):
    photos = flight(shape(40), seed=0)
    referencer = Georeferencer()
    before = referencer.update(posed(photos, 15), measured(photos))
    assert before.state is GeoreferenceState.METRIC
    photos.enu[10:] += (150.0, 80.0, 0.0)  # most of all now agree on another place
    moved = pycolmap.Sim3d(3.0, pycolmap.Rotation3d(np.array([0.4, 1.0, -0.3])), [5.0, 6.0, 7.0])
    after = referencer.update(posed(photos, moved=moved), measured(photos))
    assert after.state is GeoreferenceState.METRIC
    assert after.held
    assert "the frame is held" in after.reasons[-1]
    np.testing.assert_allclose(
        places_m(after, posed(photos, moved=moved))[:15],
        places_m(before, posed(photos, 15)),
        atol=0.01,
    )
    assert np.flatnonzero(~after.alignment.inliers).tolist() == list(range(10, 40))


def test_a_metric_frame_does_not_fall_back(photos):
    referencer = Georeferencer()
    referencer.update(posed(photos), measured(photos))
    few = dict(list(measured(photos).items())[:4])
    found = referencer.update(posed(photos), few)
    assert found.state is GeoreferenceState.METRIC
    assert found.held
    assert "4 positions" in found.reasons[-1]


def test_a_model_of_other_photos_is_judged_afresh_in_the_same_frame(photos):
    referencer = Georeferencer()
    first = referencer.update(posed(photos, 20), measured(photos))
    others = {image_id: pose for image_id, pose in posed(photos).items() if image_id > 20}
    three = dict(list(others.items())[:3])
    assert referencer.update(three, measured(photos)).state is GeoreferenceState.PROVISIONAL
    found = referencer.update(others, measured(photos))
    assert found.state is GeoreferenceState.METRIC
    assert found.frame == first.frame


def test_a_resumed_session_holds_the_frame(photos):
    referencer, resumed = Georeferencer(), Georeferencer()
    before = referencer.update(posed(photos, 15), measured(photos))
    resumed.restore(json.loads(json.dumps(referencer.as_json())))
    photos.enu[10:] += (150.0, 80.0, 0.0)
    expected = referencer.update(posed(photos), measured(photos))
    found = resumed.update(posed(photos), measured(photos))
    assert found.frame == before.frame
    assert found.reasons == expected.reasons
    np.testing.assert_allclose(
        found.alignment.enu_from_model.matrix(), expected.alignment.enu_from_model.matrix()
    )


def test_a_new_session_is_remembered_as_that():
    referencer = Georeferencer()
    referencer.restore(json.loads(json.dumps(Georeferencer().as_json())))
    assert referencer.update({}, {}).frame is None


def test_photos_with_and_without_positions_are_mixed(photos):
    positions = {i: position for i, position in measured(photos).items() if i % 3 == 0}
    found = Georeferencer().update(posed(photos), positions)
    assert found.state is GeoreferenceState.METRIC
    assert found.image_ids == tuple(range(3, 41, 3))
    nothing = Georeferencer().update(posed(photos), {})
    assert nothing.state is GeoreferenceState.NONE
    assert nothing.reasons == ("no photo has a position",)


def test_rows_are_in_the_order_of_flight_whatever_the_ids(photos):
    positions = {
        image_id: PhotoPosition(
            position=one.position,
            horizontal_sigma_m=5.0,
            vertical_sigma_m=10.0,
            captured_at=START - timedelta(seconds=image_id),
        )
        for image_id, one in measured(photos).items()
    }
    found = Georeferencer().update(posed(photos), positions)
    assert found.image_ids == tuple(range(40, 0, -1))


def test_a_model_that_something_better_holds_is_compared_and_not_moved(photos):
    photos.enu[:] += np.array([30.0, -20.0, 50.0])
    referencer, poses = Georeferencer(), posed(photos, moved=photos.enu_from_model)
    found = referencer.compare(poses, measured(photos), SITE, "held to 4 points")
    assert (found.state, found.frame) == (GeoreferenceState.METRIC, SITE)
    assert found.reasons == ("held to 4 points",)
    assert referencer.frame is None
    rows = np.array(found.image_ids) - 1
    off = photos.enu[rows] - photos.true[rows]
    np.testing.assert_allclose(found.alignment.residuals, off, atol=1e-6)
    none = referencer.compare(poses, {}, SITE, "held to 4 points")
    assert (none.state, none.alignment) == (GeoreferenceState.METRIC, None)
