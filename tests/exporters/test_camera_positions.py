"""Positions on Earth and angles of photos, in tables and on maps."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from helpers.export_scenes import exact_model
from helpers.model_building import looking, make_model

from sfm_front.errors import InputError
from sfm_front.exporters import csv_table, geojson
from sfm_front.exporters.camera_positions import camera_positions, yaw_pitch_roll_deg
from sfm_front.exporters.options import ExportOptions
from sfm_front.exporters.scene import Job, Scene
from sfm_front.geometry.enu import LocalFrame
from sfm_front.types import GeoPosition

FRAME = LocalFrame(45.0, -30.0, 200.0)
NORTH, EAST, UP = (0, 1, 0), (1, 0, 0), (0, 0, 1)
ANGLE_DEG = 1e-9
METRES_PER_DEGREE = 111_132.0  # of latitude, at 45 degrees
CENTIMETRE = 0.01


def flight(**positions):
    """Photos 10 m apart on a line to the north, looking down, top to the north."""
    cameras = {f"{i}.jpg": looking([5, 10 * i, 50], [0, 0, -1], NORTH) for i in range(3)}
    return Scene(make_model(cameras), {}, positions, FRAME)


def write(module, scene, folder):
    folder.mkdir(exist_ok=True)
    return module.write(Job(scene, folder, ExportOptions(), lambda _done, _total: None))


@pytest.mark.parametrize(
    ("towards", "up", "expected"),
    [
        ([0, 0, -1], NORTH, (0, 0, 0)),
        ([0, 0, -1], EAST, (90, 0, 0)),
        ([0, 0, -1], [0, -1, 0], (180, 0, 0)),
        ([0, 1, -1], UP, (0, 45, 0)),
        ([1, 0, -1], UP, (90, 45, 0)),
        ([-1, 0, -1], UP, (-90, 45, 0)),
        # The top to the north, the view to the west: the right side, in the east, is lowered.
        ([-1, 0, -1], NORTH, (0, 0, 45)),
        ([1, 0, -1], NORTH, (0, 0, -45)),
    ],
)
def test_angles_are_those_of_surveyors(towards, up, expected):
    pose = looking([1, 2, 3], towards, up)
    angles = yaw_pitch_roll_deg(pose.rotation.matrix())
    angles[0] = angles[0] % 360 if expected[0] == 180 else angles[0]
    np.testing.assert_allclose(angles, expected, atol=ANGLE_DEG)


def test_positions_are_on_earth_where_the_frame_says():
    positions = camera_positions(flight())
    latitudes = [p.on_earth.lat_lon_alt[0] for p in positions]
    metres = (np.array(latitudes) - 45) * METRES_PER_DEGREE
    np.testing.assert_allclose(metres, [0, 10, 20], atol=CENTIMETRE)
    assert all(p.on_earth.lat_lon_alt[1] > -30 for p in positions)
    np.testing.assert_allclose([p.on_earth.lat_lon_alt[2] for p in positions], 250, atol=CENTIMETRE)


def test_residuals_are_exif_minus_model():
    there = FRAME.to_wgs84(np.array([[4.0, 12.0, 47.0]]))[0]
    measured = GeoPosition(*map(float, there), horizontal_sigma_m=0.02)
    scene = flight(**{"1.jpg": measured, "2.jpg": GeoPosition(45.0, -30.0)})
    first, second, third = (p.on_earth for p in camera_positions(scene))
    np.testing.assert_allclose(second.residual_enu_m, [-1, 2, -3], atol=1e-6)
    assert (second.horizontal_sigma_m, second.vertical_sigma_m) == (0.02, None)
    assert first.residual_enu_m is third.residual_enu_m is None


def test_a_csv_reader_reads_the_table(tmp_path):
    assert write(csv_table, flight(), tmp_path / "out") == []
    with (tmp_path / "out" / "cameras.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == ["0.jpg", "1.jpg", "2.jpg"]
    assert [float(rows[1][name]) for name in ("east_m", "north_m", "up_m")] == [5, 10, 50]
    assert float(rows[1]["latitude_deg"]) == pytest.approx(45 + 10 / METRES_PER_DEGREE, abs=1e-8)
    assert [float(rows[1][name]) for name in ("yaw_deg", "pitch_deg", "roll_deg")] == [0, 0, 0]
    assert rows[1]["residual_east_m"] == rows[1]["horizontal_sigma_m"] == ""


def test_without_a_frame_the_table_has_model_coordinates_and_says_so(tmp_path):
    scene = Scene(exact_model(names=('a, "b".png', "c.png")), {}, {}, None)
    (note,) = write(csv_table, scene, tmp_path / "out")
    assert "not georeferenced" in note
    with (tmp_path / "out" / "cameras.csv").open(newline="", encoding="utf-8") as file:
        first, second = csv.DictReader(file)
    assert first["name"] == 'a, "b".png'
    assert [float(second[axis]) for axis in "xyz"] == [1, 0, 0.1]
    assert "latitude_deg" not in first


def test_geojson_is_valid_and_in_its_order(tmp_path):
    write(geojson, flight(), tmp_path / "out")
    text = (tmp_path / "out" / "cameras.geojson").read_text(encoding="utf-8")
    content = json.loads(text)
    assert content["type"] == "FeatureCollection"
    first = content["features"][0]
    longitude, latitude, altitude = first["geometry"]["coordinates"]
    assert (round(longitude), round(latitude), round(altitude)) == (-30, 45, 250)
    assert first["properties"]["name"] == "0.jpg"
    reader = pytest.importorskip("geojson")
    read = reader.loads(text)
    assert read.is_valid
    assert len(read.features) == 3


def test_geojson_of_a_model_without_a_frame_is_refused(tmp_path):
    scene = Scene(exact_model(), {}, {}, None)
    with pytest.raises(InputError, match=r"not georeferenced .* export --to csv"):
        write(geojson, scene, tmp_path / "out")
