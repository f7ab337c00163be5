"""georeference.json: what is written is what is read."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from helpers.flight_making import flight, strips, thrown

from sfm_front.errors import InputError
from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference import sidecar as sidecar_module
from sfm_front.georeference.alignment import align
from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.flight_figures import FlightFigures
from sfm_front.georeference.georeferencer import Georeference
from sfm_front.georeference.sidecar import (
    FILE_NAME,
    Sidecar,
    read_sidecar,
    sidecar_of,
    write_sidecar,
)
from sfm_front.georeference.spread import GeoreferenceState

BUILT = pycolmap.Sim3d(2.0, pycolmap.Rotation3d(np.array([0.1, 0.2, 0.3])), [4.0, 5.0, 6.0])
FRAME = LocalFrame(46.84, -91.99, 300.0)


@pytest.fixture
def full() -> Sidecar:
    photos = flight(strips(40), seed=0)
    labels = (np.arange(40) >= 20).astype(np.int64)
    photos.enu[labels == 1, 2] += 15.0
    thrown(photos, np.array([6]), 200.0, 0)
    alignment = align(photos.centres, photos.fixes(flights=labels), photos.cam_from_model)
    ids = range(1, 41)
    georeference = Georeference(
        state=GeoreferenceState.METRIC,
        frame=FRAME,
        alignment=alignment,
        image_ids=tuple(ids),
        cam_from_model=tuple(photos.poses()),
    )
    return sidecar_of(
        georeference,
        {image_id: f"{image_id}.jpg" for image_id in ids},
        {"ä.jpg": "altitude 0 where others have one"},
        enu_from_built=BUILT,
        models_in_enu=(0,),
        flight=FlightFigures(2.1, 55.0, 12_100.0),
    )


def test_everything_comes_back(full, tmp_path):
    file = tmp_path / FILE_NAME
    write_sidecar(file, full)
    found = read_sidecar(file)
    np.testing.assert_allclose(found.enu_from_built.matrix(), BUILT.matrix())
    for name in Sidecar.__dataclass_fields__:
        if name != "enu_from_built":
            assert getattr(found, name) == getattr(full, name), name


def test_the_file_says_what_a_surveyor_asks(full, tmp_path):
    file = tmp_path / FILE_NAME
    write_sidecar(file, full)
    row = json.loads(file.read_text(encoding="utf-8"))
    assert row["state"] == "metric"
    assert row["crs"]["vertical_datum"] == "unknown"
    assert row["origin"] == {"latitude_deg": 46.84, "longitude_deg": -91.99, "altitude_m": 300.0}
    (outlier,) = row["residuals"]["outliers"]
    assert outlier["name"] == "7.jpg"
    assert outlier["metres"] == pytest.approx(200, abs=6)
    assert row["left_out"] == [{"name": "ä.jpg", "reason": "altitude 0 where others have one"}]
    ((offset),) = row["height_offsets"]
    assert abs(offset["metres"]) == pytest.approx(15, abs=5)
    assert 0 < row["uncertainty"]["scale"] < 0.1


def test_no_georeference_is_said_too(tmp_path):
    nothing = sidecar_of(
        Georeference(reasons=("no photo has a position",)),
        {},
        {},
        enu_from_built=None,
        models_in_enu=(),
    )
    write_sidecar(tmp_path / FILE_NAME, nothing)
    assert read_sidecar(tmp_path / FILE_NAME) == nothing
    assert nothing.state is GeoreferenceState.NONE


def test_control_points_come_back_and_may_be_absent(full, tmp_path):
    control = ControlReport(file="gcp_list.txt", not_used="line 3 is wrong", missing_photos=("a",))
    file = tmp_path / FILE_NAME
    write_sidecar(file, replace(full, control_points=control))
    assert read_sidecar(file).control_points == control
    row = json.loads(file.read_text(encoding="utf-8"))
    del row["control_points"]  # as files of earlier versions
    file.write_text(json.dumps(row), encoding="utf-8")
    assert read_sidecar(file).control_points is None


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"version": 1}'])
def test_another_file_is_refused_in_one_line(content, tmp_path):
    file = tmp_path / FILE_NAME
    file.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(str(file))) as refused:
        read_sidecar(file)
    assert "\n" not in str(refused.value)


def test_a_missing_file_and_another_version_are_refused(full, tmp_path, monkeypatch):
    file = tmp_path / FILE_NAME
    with pytest.raises(InputError, match="cannot be read"):
        read_sidecar(file)
    monkeypatch.setattr(sidecar_module, "VERSION", 2)
    write_sidecar(file, full)
    monkeypatch.undo()
    with pytest.raises(InputError, match="version 2"):
        read_sidecar(file)
