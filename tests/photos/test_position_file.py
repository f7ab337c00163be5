"""Files of positions: both forms, and each mistake with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from sfm_front.errors import InputError
from sfm_front.photos.position_file import read_position_file
from sfm_front.types import GeoPosition


def read(folder: Path, text: str) -> dict[str, GeoPosition]:
    file = folder / "positions.txt"
    file.write_text(text, encoding="utf-8")
    return read_position_file(file)


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_csv(tmp_path: Path, delimiter: str) -> None:
    text = "name,lat,lon,alt,h_acc,v_acc\na.jpg,47.5,8.25,512,0.02,0.05\nb.jpg,-33,151.5,-1e1,,\n"
    assert read(tmp_path, text.replace(",", delimiter)) == {
        "a.jpg": GeoPosition(47.5, 8.25, 512.0, 0.02, 0.05),
        "b.jpg": GeoPosition(-33.0, 151.5, -10.0),
    }


def test_columns_come_in_any_order_under_other_names(tmp_path: Path) -> None:
    text = (
        "# from the receiver\n"
        'Altitude (m), Longitude,"Yaw",Image Name,LATITUDE [deg]\n'
        '512, 8.25, north, "flight 1, east/süd.jpg", 47.5\n'
        "\n"
        ", 8.5, , .\\flight\\b.jpg, 47\n"
    )
    assert read(tmp_path, text) == {
        "flight 1, east/süd.jpg": GeoPosition(47.5, 8.25, 512.0),
        "flight/b.jpg": GeoPosition(47.0, 8.5),
    }


def test_altitudes_may_be_left_out(tmp_path: Path) -> None:
    assert read(tmp_path, "name,lat,lon\na.jpg,1,2\n") == {"a.jpg": GeoPosition(1.0, 2.0)}


def test_windows_saves_with_a_mark_and_other_line_ends(tmp_path: Path) -> None:
    file = tmp_path / "positions.csv"
    file.write_bytes("name,lat,lon,alt\r\na.jpg,1,2,3\r\n".encode("utf-8-sig"))
    assert read_position_file(file) == {"a.jpg": GeoPosition(1.0, 2.0, 3.0)}


@pytest.mark.parametrize(
    ("row", "position"),
    [
        ("8.25 47.5", GeoPosition(47.5, 8.25)),
        ("8.25\t47.5   512", GeoPosition(47.5, 8.25, 512.0)),
        ("8.25 47.5 512 0.02 0.05", GeoPosition(47.5, 8.25, 512.0, 0.02, 0.05)),
        ("8.25 47.5 512 90 0 -5", GeoPosition(47.5, 8.25, 512.0)),
        ("8.25 47.5 512 90 0 -5 0.02 0.05", GeoPosition(47.5, 8.25, 512.0, 0.02, 0.05)),
        ("8.25 47.5 512 90 0 -5 0.02 0.05 a note", GeoPosition(47.5, 8.25, 512.0, 0.02, 0.05)),
    ],
)
def test_geo_txt(tmp_path: Path, row: str, position: GeoPosition) -> None:
    assert read(tmp_path, f"EPSG:4326\n# x is the longitude\na.jpg {row}\n") == {"a.jpg": position}


def test_csv_may_name_its_system_too(tmp_path: Path) -> None:
    text = "EPSG:4326\nname,x,y,z\na.jpg,8.25,47.5,512\n"
    assert read(tmp_path, text) == {"a.jpg": GeoPosition(47.5, 8.25, 512.0)}


def test_both_forms_in_utm(tmp_path: Path) -> None:
    pytest.importorskip("pyproj", reason="the extra geo is not installed")
    # On the central meridian, at 45°, where the northing is 4 982 950.400 m.
    for text in (
        "WGS84 UTM 32N\na.jpg 500000 4982950.4 100 0.5 1\n",
        "EPSG:32632\nname;easting;northing;alt;h_acc;v_acc\na.jpg;500000;4982950.4;100;0.5;1\n",
    ):
        (position,) = read(tmp_path, text).values()
        assert position.longitude_deg == pytest.approx(9.0, abs=1e-9)
        assert position.latitude_deg == pytest.approx(45.0, abs=1e-7)
        assert position.altitude_m == 100.0
        assert (position.horizontal_sigma_m, position.vertical_sigma_m) == (0.5, 1.0)


HEADER = "name,lat,lon,alt\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "positions.txt: is empty"),
        ("# a note\n", "positions.txt: is empty"),
        ("a.jpg 8 47 512\n", ":1: should be a header with name, lat, lon and alt, or"),
        ("name,lon,alt\na.jpg,8,512\n", ":1: the header has no lat"),
        ("name,x,y\na.jpg,8,47\n", ":1: the header has no lat"),
        ("name,lat,latitude,lon\na.jpg,8,8,47\n", ":1: lat and latitude are the same"),
        (HEADER, "holds no position below its header"),
        ("EPSG:4326\n", "holds no position below its header"),
        (HEADER + "a.jpg,47,8,1\n\nb.jpg,47\n", ":4: has 2 columns, fewer than the header"),
        (HEADER + "a.jpg,fourty,8,1\n", ":2: y (or lat) is 'fourty', which is no number"),
        (HEADER + "a.jpg,47,,1\n", ":2: x (or lon) is '', which is no number"),
        (HEADER + "a.jpg,47,8,nan\n", ":2: z (or alt) is 'nan', which is no number"),
        (HEADER + ",47,8,1\n", ":2: names no photo"),
        (HEADER + "a.jpg,8,147,1\nb.jpg,147,8,1\n", ":3: (8, 147) is no place in EPSG:4326"),
        (HEADER + "a.jpg,1,2,3\nA.JPG,1,2,3\n", ":3: A.JPG stands in line 2 too"),
        ("name,lat,lon,h_acc\na.jpg,1,2,0\n", ":2: h_acc must be above 0 m, got 0"),
        ("EPSG:4326\na.jpg 8\n", ":2: has 1 numbers"),
        ("EPSG:4326\na.jpg 8 47 512 0.02\n", ":2: has 4 numbers"),
        ("EPSG:4326\nmy photo.jpg 8 47\n", ":2: x (or lon) is 'photo.jpg', which is no number"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError) as raised:
        read(tmp_path, text)
    assert str(raised.value).startswith(str(tmp_path / "positions.txt"))
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        read_position_file(tmp_path / "none.csv")
    with pytest.raises(InputError, match="cannot be read"):
        read_position_file(tmp_path)
    (tmp_path / "a.csv").write_bytes("name,lat,lon\nsüd.jpg,1,2\n".encode("latin-1"))
    with pytest.raises(InputError, match=r"a\.csv: not UTF-8 at byte 14"):
        read_position_file(tmp_path / "a.csv")


def test_a_system_that_is_none_is_named_with_the_file(tmp_path: Path) -> None:
    pytest.importorskip("pyproj", reason="the extra geo is not installed")
    with pytest.raises(InputError, match=r"positions\.txt: 'EPSG:1' is no reference system"):
        read(tmp_path, "EPSG:1\na.jpg 1 2\n")
