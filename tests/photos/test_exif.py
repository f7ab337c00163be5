"""EXIF: everything that is used, and every way in which it is broken."""

from __future__ import annotations

import io
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from sfm_front.photos.exif import FULL_FRAME_DIAGONAL_MM, read_exif
from sfm_front.photos.reader import PhotoReader
from sfm_front.types import Exif, Photo


def encoded(kind: str, exif: bytes) -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (160, 120), (90, 120, 30)).save(buffer, kind, exif=exif)
    return buffer.getvalue()


def exif_bytes(
    main: dict[int, Any], details: dict[int, Any] | None = None, gps: dict[int, Any] | None = None
) -> bytes:
    exif = Image.Exif()
    for tag, value in main.items():
        exif[tag] = value
    exif.get_ifd(0x8769).update(details or {})
    exif.get_ifd(0x8825).update(gps or {})
    return exif.tobytes()


def read_photo(folder: Path, data: bytes) -> Photo:
    (folder / "a.jpg").write_bytes(data)
    photo = PhotoReader().read(folder / "a.jpg", "a.jpg")
    assert isinstance(photo, Photo), photo
    return photo


def with_exif(
    folder: Path,
    main: dict[int, Any],
    details: dict[int, Any] | None = None,
    gps: dict[int, Any] | None = None,
    kind: str = "JPEG",
) -> Exif:
    """The tags after a round through a file, read with its pixels and, the same, without."""
    exif = read_photo(folder, encoded(kind, exif_bytes(main, details, gps))).exif
    assert read_exif(folder / "a.jpg") == exif
    return exif


GPS = {1: "S", 2: (33.0, 51.0, 25.2), 3: "W", 4: (151.0, 12.0, 40.0), 5: b"\x01", 6: 12.5}


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP", "TIFF"])
def test_everything_that_is_used_is_read(tmp_path: Path, kind: str) -> None:
    exif = with_exif(
        tmp_path,
        {0x010F: "Canon", 0x0110: "Canon EOS 5D"},
        {0x920A: 24.0, 0xA405: 38, 0x9003: "2021:07:04 10:11:12", 0x9291: "25"},
        GPS,
        kind,
    )
    assert (exif.make, exif.model) == ("Canon", "Canon EOS 5D")
    assert (exif.focal_length_mm, exif.focal_length_35mm) == (24.0, 38.0)
    assert exif.captured_at == datetime(2021, 7, 4, 10, 11, 12, 250_000)
    assert exif.position is not None
    assert exif.position.latitude_deg == pytest.approx(-(33 + 51 / 60 + 25.2 / 3600), abs=1e-9)
    assert exif.position.longitude_deg == pytest.approx(-(151 + 12 / 60 + 40 / 3600), abs=1e-9)
    assert exif.position.altitude_m == -12.5


def test_no_exif_is_an_empty_exif(tmp_path: Path) -> None:
    exif = with_exif(tmp_path, {})
    assert exif == Exif()


def test_padding_after_nul_is_not_part_of_a_name(tmp_path: Path) -> None:
    exif = with_exif(tmp_path, {0x010F: "DJI\0\0\0\0", 0x0110: " FC300S\0rest"})
    assert (exif.make, exif.model) == ("DJI", "FC300S")


@pytest.mark.parametrize(
    ("tag", "value"),
    [
        (2, (IFDRational(33, 0), 51.0, 25.2)),
        (2, (95.0, 0.0, 0.0)),
        (2, (1.0, 2.0, 3.0, 4.0)),
        (4, (181.0, 0.0, 0.0)),
        (4, (IFDRational(0, 0), IFDRational(0, 0), IFDRational(0, 0))),
    ],
)
def test_an_impossible_position_is_none(tmp_path: Path, tag: int, value: Any) -> None:
    assert with_exif(tmp_path, {}, gps=GPS).position is not None
    assert with_exif(tmp_path, {}, gps={**GPS, tag: value}).position is None


def test_null_island_is_no_fix_but_the_equator_is_one(tmp_path: Path) -> None:
    zero = (0.0, 0.0, 0.0)
    nowhere = with_exif(tmp_path, {}, gps={**GPS, 2: zero, 4: zero}).position
    assert nowhere is not None
    assert not nowhere.is_fix
    equator = with_exif(tmp_path, {}, gps={**GPS, 2: zero}).position
    assert equator is not None
    assert equator.latitude_deg == 0
    assert equator.is_fix


def test_a_phone_says_how_exact_its_position_is(tmp_path: Path) -> None:
    for written, sigma in ((4.75, 4.75), (0.0, None), (IFDRational(1, 0), None)):
        position = with_exif(tmp_path, {}, gps={**GPS, 0x001F: written}).position
        assert position is not None
        assert position.horizontal_sigma_m == sigma
        assert position.vertical_sigma_m is None


def test_a_position_without_altitude_has_none(tmp_path: Path) -> None:
    without = {tag: value for tag, value in GPS.items() if tag != 6}
    for gps in (without, {**GPS, 6: IFDRational(1, 0)}):
        position = with_exif(tmp_path, {}, gps=gps).position
        assert position is not None
        assert position.altitude_m is None


@pytest.mark.parametrize("focal", [0.0, IFDRational(0, 0), IFDRational(50, 0)])
def test_a_focal_length_that_is_no_number_is_none(tmp_path: Path, focal: Any) -> None:
    exif = with_exif(tmp_path, {}, {0x920A: focal, 0xA405: 0})
    assert exif.focal_length_mm is None
    assert exif.focal_length_35mm is None


def test_sensor_size_gives_the_35_mm_equivalent_of_a_shrunk_photo(tmp_path: Path) -> None:
    """A 24 x 18 mm sensor of 4000 x 3000 pixels, the photo shrunk later to 160 x 120."""
    per_inch = 4000 / 24 * 25.4
    details = {0x920A: 30.0, 0xA20E: per_inch, 0xA20F: per_inch, 0xA210: 2}
    exif = with_exif(tmp_path, {}, {**details, 0xA002: 4000, 0xA003: 3000})
    expected = 30.0 * FULL_FRAME_DIAGONAL_MM / 30.0  # The sensor's diagonal is 30 mm.
    assert exif.focal_length_35mm == pytest.approx(expected, rel=1e-4)
    for broken in ({0xA210: 1}, {0xA20E: IFDRational(1, 0)}, {0xA20E: 1e-3, 0xA20F: 1e-3}):
        exif = with_exif(tmp_path, {}, {**details, 0xA002: 4000, 0xA003: 3000, **broken})
        assert exif.focal_length_35mm is None
        assert exif.focal_length_mm == 30.0


@pytest.mark.parametrize("text", ["0000:00:00 00:00:00", "2021:13:45 10:11:12", "yesterday", ""])
def test_an_impossible_time_is_none(tmp_path: Path, text: str) -> None:
    assert with_exif(tmp_path, {}, {0x9003: text}).captured_at is None


def test_the_time_of_change_stands_in_for_that_of_capture(tmp_path: Path) -> None:
    changed = {0x0132: "2020:02:03 04:05:06"}
    assert with_exif(tmp_path, changed).captured_at == datetime(2020, 2, 3, 4, 5, 6)
    exif = with_exif(tmp_path, changed, {0x9003: "2019:02:03 04:05:06"})
    assert exif.captured_at == datetime(2019, 2, 3, 4, 5, 6)


def test_an_orientation_out_of_range_is_the_usual_one(tmp_path: Path) -> None:
    assert with_exif(tmp_path, {0x0112: 9}).orientation == 1


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_damaged_exif_never_costs_the_photo(tmp_path: Path) -> None:
    details = {0x920A: 24.0, 0x9003: "2021:07:04 10:11:12"}
    data = encoded("JPEG", exif_bytes({0x010F: "Canon"}, details, GPS))
    start = data.index(b"Exif\0\0") + 6
    rng = np.random.default_rng(1)
    for _ in range(60):
        broken = bytearray(data)
        at = start + int(rng.integers(0, 150))
        broken[at : at + 4] = rng.bytes(4)
        assert read_photo(tmp_path, bytes(broken)).width == 160


def test_exif_of_what_is_no_image_is_empty(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"nothing of the kind")
    assert read_exif(tmp_path / "a.jpg").captured_at is None
    assert read_exif(tmp_path / "missing.jpg").captured_at is None


@pytest.mark.parametrize("fraction", ["9" * 400, "9" * 12, "5"])
def test_a_fraction_of_a_second_never_costs_the_photo(tmp_path: Path, fraction: str) -> None:
    """At the calendar's end, rounding up to a whole second left it."""
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x9003: "9999:12:31 23:59:59", 0x9291: fraction})
    photo = read_photo(tmp_path, encoded("JPEG", exif.tobytes()))
    assert photo.exif.captured_at is not None
    assert photo.exif.captured_at.year == 9999
