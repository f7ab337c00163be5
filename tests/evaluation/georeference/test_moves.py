"""How far what was said moves, in units of its own uncertainty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from helpers.flight_making import flight, strips

from sfm_front.evaluation.georeference.moves import FirstSaid, Move
from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.alignment import align
from sfm_front.georeference.georeferencer import Georeference
from sfm_front.georeference.spread import GeoreferenceState


@pytest.fixture
def said() -> Georeference:
    photos = flight(strips(20), seed=0)
    return Georeference(
        state=GeoreferenceState.METRIC,
        frame=LocalFrame(46.84, -91.99, 300.0),
        alignment=align(photos.centres, photos.fixes(), photos.cam_from_model),
        image_ids=tuple(range(1, 21)),
        cam_from_model=tuple(photos.poses()),
    )


def moved(said: Georeference, change: pycolmap.Sim3d) -> Georeference:
    """The same once ENU has moved by that."""
    enu_from_model = change * said.alignment.enu_from_model
    return replace(said, alignment=replace(said.alignment, enu_from_model=enu_from_model))


def test_what_stays_has_not_moved(said):
    move = FirstSaid.of(said).move_to(said)
    assert [move.scale, move.tilt, move.heading, move.cameras] == pytest.approx([0] * 4, abs=1e-4)


@pytest.mark.parametrize("sign", [-1, 1])
def test_each_kind_is_in_its_own_standard_deviations(said, sign):
    first, alignment = FirstSaid.of(said), said.alignment
    turned = pycolmap.Rotation3d(np.array([0, 0, sign * np.radians(2 * first.heading_sigma_deg)]))
    move = first.move_to(moved(said, pycolmap.Sim3d(1.0, turned, np.zeros(3))))
    assert move.heading == pytest.approx(2, abs=0.01)
    assert move.tilt == pytest.approx(0, abs=0.01)
    tilted = pycolmap.Rotation3d(np.array([sign * np.radians(3 * first.tilt_sigma_deg), 0, 0]))
    move = first.move_to(moved(said, pycolmap.Sim3d(1.0, tilted, np.zeros(3))))
    assert move.tilt == pytest.approx(3, abs=0.01)
    grown = pycolmap.Sim3d(
        float(np.exp(sign * 4 * alignment.scale_sigma)), pycolmap.Rotation3d(), np.zeros(3)
    )
    assert first.move_to(moved(said, grown)).scale == pytest.approx(4, abs=0.01)
    shift = np.array([0, 0, sign * 100.0])
    move = first.move_to(moved(said, pycolmap.Sim3d(1.0, pycolmap.Rotation3d(), shift)))
    centres = np.array([pose.inverse().translation for pose in said.cam_from_model])
    up_m = np.median(alignment.position_sigmas_m(centres)[:, 2])
    assert move.cameras == pytest.approx(100 / up_m, rel=0.01)
    assert move.scale == pytest.approx(0, abs=1e-3)


def test_of_too_few_photos_nothing_is_known(said):
    other = Georeference(
        alignment=said.alignment, image_ids=(1, 2), cam_from_model=said.cam_from_model[:2]
    )
    assert FirstSaid.of(said).move_to(other) is None


def test_the_largest_is_that_of_each_kind():
    assert Move.largest([Move(1, 4, 1, 0), Move(2, 3, 0, 0)]) == Move(2, 4, 1, 0)
