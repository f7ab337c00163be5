"""EXIF of a stored photo: what is read back is what was written, now or by earlier versions."""

from __future__ import annotations

import json
from datetime import datetime

import pytest

from sfm_front.storage.photo_json import exif_of_row, exif_row
from sfm_front.types import Exif, GeoPosition, GimbalAngles

FULL = Exif(
    make="DJI",
    model="FC6310R",
    focal_length_mm=8.8,
    focal_length_35mm=24.0,
    captured_at=datetime(2021, 7, 4, 10, 11, 12, 250_000),
    position=GeoPosition(47.5, 8.25, 512.0, 0.013, 0.025),
    orientation=6,
    gimbal=GimbalAngles(-12.5, -90.0, 0.0),
)


@pytest.mark.parametrize("exif", [Exif(), FULL, Exif(position=GeoPosition(0.0, 0.0))])
def test_what_is_written_is_read_back(exif: Exif) -> None:
    assert exif_of_row(json.loads(json.dumps(exif_row(exif)))) == exif


def test_rows_of_earlier_versions_are_read() -> None:
    """Their positions have no standard deviations, and they know of no gimbal."""
    row = {
        "make": "",
        "model": "",
        "focal_length_mm": None,
        "focal_length_35mm": None,
        "captured_at": None,
        "position": [47.5, 8.25, None],
        "orientation": 1,
    }
    assert exif_of_row(row) == Exif(position=GeoPosition(47.5, 8.25))
