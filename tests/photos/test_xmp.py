"""XMP: what drones write of position and gimbal, in files and broken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers.xmp_making import dji, jpeg, packet
from PIL import Image

from sfm_front.photos.exif import read_exif
from sfm_front.photos.reader import PhotoReader
from sfm_front.photos.xmp import Xmp, read_xmp
from sfm_front.types import Exif, GeoPosition, GimbalAngles, Photo

RTK = {"RtkStdLon": "0.01100", "RtkStdLat": "0.01300", "RtkStdHgt": "0.02500"}


def exif_bytes(error_m: float | None = None) -> bytes:
    """47.5° north, 8.25° east, at 80 m; with a horizontal positioning error, if there is one."""
    exif = Image.Exif()
    gps = {1: "N", 2: (47.0, 30.0, 0.0), 3: "E", 4: (8.0, 15.0, 0.0), 5: b"\0", 6: 80.0}
    exif.get_ifd(0x8825).update(gps if error_m is None else {**gps, 0x001F: error_m})
    return exif.tobytes()


def read(folder: Path, xmp: bytes, exif: bytes = b"") -> Exif:
    """EXIF of a JPEG with this XMP, read with its pixels and, the same, without."""
    path = folder / "a.jpg"
    path.write_bytes(jpeg(xmp, exif))
    photo = PhotoReader().read(path, "a.jpg")
    assert isinstance(photo, Photo), photo
    assert read_exif(path) == photo.exif
    return photo.exif


def test_djis_altitude_overrides_that_of_exif(tmp_path: Path) -> None:
    exif = read(tmp_path, dji(AbsoluteAltitude="+512.34", RelativeAltitude="+40.1"), exif_bytes())
    assert exif.position == GeoPosition(47.5, 8.25, 512.34)


@pytest.mark.parametrize("written", ["+0.00", "nan", "high"])
def test_an_altitude_that_is_none_leaves_that_of_exif(tmp_path: Path, written: str) -> None:
    exif = read(tmp_path, dji(AbsoluteAltitude=written), exif_bytes())
    assert exif.position == GeoPosition(47.5, 8.25, 80.0)


def test_rtk_counts_while_it_is_fixed(tmp_path: Path) -> None:
    fixed = read(tmp_path, dji(RtkFlag="50", **RTK), exif_bytes())
    assert fixed.position == GeoPosition(47.5, 8.25, 80.0, 0.013, 0.025)
    for flag in ("34", "16", "0"):
        exif = read(tmp_path, dji(RtkFlag=flag, **RTK), exif_bytes())
        assert exif.position == GeoPosition(47.5, 8.25, 80.0)
    zero = dict.fromkeys(RTK, "0")
    exif = read(tmp_path, dji(RtkFlag="50", **zero), exif_bytes())
    assert exif.position == GeoPosition(47.5, 8.25, 80.0)


def test_what_exif_measured_is_overridden_by_rtk(tmp_path: Path) -> None:
    measured = exif_bytes(error_m=3.5)
    position = read(tmp_path, dji(RtkFlag="34", **RTK), measured).position
    assert position == GeoPosition(47.5, 8.25, 80.0, 3.5)
    position = read(tmp_path, dji(RtkFlag="50", **RTK), measured).position
    assert position == GeoPosition(47.5, 8.25, 80.0, 0.013, 0.025)


@pytest.mark.parametrize("longitude", ["GpsLongitude", "GpsLongtitude"])
def test_the_place_counts_where_exif_has_none(tmp_path: Path, longitude: str) -> None:
    place = {"GpsLatitude": "-33.5", longitude: "+151.25", "AbsoluteAltitude": "-3.5"}
    assert read(tmp_path, dji(**place)).position == GeoPosition(-33.5, 151.25, -3.5)
    both = read(tmp_path, dji(**place), exif_bytes()).position
    assert both == GeoPosition(47.5, 8.25, -3.5)
    for impossible in ("191", "", "W 12"):
        assert read(tmp_path, dji(**{**place, longitude: impossible})).position is None


def test_the_gimbals_angles_are_kept(tmp_path: Path) -> None:
    angles = {"GimbalYawDegree": "-12.5", "GimbalPitchDegree": "-90.0", "GimbalRollDegree": "+0.1"}
    assert read(tmp_path, dji(**angles)).gimbal == GimbalAngles(-12.5, -90.0, 0.1)
    assert read(tmp_path, dji(**angles)).position is None
    del angles["GimbalRollDegree"]
    assert read(tmp_path, dji(**angles)).gimbal is None


def test_properties_may_be_elements(tmp_path: Path) -> None:
    xmp = packet(
        elements="<drone-dji:AbsoluteAltitude>\n 12.5 </drone-dji:AbsoluteAltitude>"
        "<drone-dji:RtkFlag>50</drone-dji:RtkFlag><drone-dji:RtkStdHgt>0.02</drone-dji:RtkStdHgt>"
    )
    assert read(tmp_path, xmp, exif_bytes()).position == GeoPosition(47.5, 8.25, 12.5, None, 0.02)


def test_the_accuracy_that_parrot_and_sensefly_write(tmp_path: Path) -> None:
    xmp = packet(attributes='Camera:GPSXYAccuracy="1.5" Camera:GPSZAccuracy="2.75"')
    assert read(tmp_path, xmp, exif_bytes()).position == GeoPosition(47.5, 8.25, 80.0, 1.5, 2.75)


@pytest.mark.parametrize("kind", ["PNG", "WEBP", "TIFF"])
def test_other_formats_have_it_too(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "a"
    image = Image.new("RGB", (160, 120))
    xmp = dji(GpsLatitude="1.5", GpsLongitude="2.5")
    if kind == "PNG":
        from PIL.PngImagePlugin import PngInfo

        info = PngInfo()
        info.add_itxt("XML:com.adobe.xmp", xmp.decode())
        image.save(path, kind, pnginfo=info)
    elif kind == "TIFF":
        image.save(path, kind, tiffinfo={700: xmp})
    else:
        image.save(path, kind, xmp=xmp)
    assert read_exif(path).position == GeoPosition(1.5, 2.5)


def test_what_is_no_well_formed_xml_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    """Some firmware repeats attributes, forgets to declare them, or is cut off."""
    xmp = dji(AbsoluteAltitude="+5.5", GimbalYawDegree="1", Odd='a"b')
    for broken in (xmp, xmp.replace(b"xmlns:drone-dji", b"xmlns:other"), xmp[:-80]):
        position = read(tmp_path, broken, exif_bytes()).position
        assert position == GeoPosition(47.5, 8.25, 5.5)


def test_other_properties_are_not_taken_for_these() -> None:
    for attributes in ('my-drone-dji:AbsoluteAltitude="1"', 'drone-dji:AbsoluteAltitudes="1"'):
        assert read_xmp(packet(attributes=attributes)) == Xmp()


@pytest.mark.parametrize("nothing", [None, b"", "", 7, (60, 61), b"\xff\xfe\x00", b"<" * 10_000])
def test_what_is_no_xmp_is_nothing(nothing: object) -> None:
    assert read_xmp(nothing) == Xmp()


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_damaged_xmp_never_costs_the_photo(tmp_path: Path) -> None:
    xmp = dji(AbsoluteAltitude="+5.5", RtkFlag="50", **RTK)
    rng = np.random.default_rng(1)
    for _ in range(60):
        broken = bytearray(xmp)
        at = int(rng.integers(0, len(xmp) - 4))
        broken[at : at + 4] = rng.bytes(4)
        assert read(tmp_path, bytes(broken), exif_bytes()).position is not None


def test_a_packet_without_end_takes_no_time() -> None:
    """Entities that multiply are never expanded, and more than a megabyte is not looked at."""
    bomb = b"<!DOCTYPE a [<!ENTITY b '" + b"drone-dji:" * 200_000 + b"'>]>"
    assert read_xmp(bomb + dji(AbsoluteAltitude="1")) == Xmp()
