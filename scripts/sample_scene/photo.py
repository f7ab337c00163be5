"""Save a rendered picture as a drone's camera would: sensor noise, JPEG, EXIF with GPS."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pycolmap
from numpy.typing import NDArray
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base
from PIL.TiffImagePlugin import IFDRational

from .noise import Floats

# In the middle of the Atlantic, so that no real village is meant.
ORIGIN_LATITUDE_DEG, ORIGIN_LONGITUDE_DEG, ORIGIN_ALTITUDE_M = 45.0, -30.0, 200.0
GPS_NOISE_M = 1.0
SENSOR_NOISE = 1.3  # standard deviation in grey levels
JPEG_QUALITY = 88
_FIRST_PHOTO_AT = datetime(2024, 6, 21, 16, 0, 0)
_SECONDS_BETWEEN_PHOTOS = 4
_SENSOR_DIAGONAL_MM = 7.66  # a 1/2.3 inch sensor
_DIAGONAL_35MM = float(np.hypot(36.0, 24.0))


def save_photo(
    path: Path,
    picture: Floats,
    *,
    number: int,
    camera: pycolmap.Camera,
    cam_from_world: pycolmap.Rigid3d,
    seed: int,
) -> None:
    """Write a picture (H, W, 3) in [0, 1] with the EXIF of its camera and pose."""
    rng = np.random.default_rng(seed)
    noisy = 255.0 * _vignetted(picture) + rng.normal(0.0, SENSOR_NOISE, picture.shape)
    pixels = np.clip(np.round(noisy), 0, 255).astype(np.uint8)
    centre = -cam_from_world.rotation.matrix().T @ cam_from_world.translation
    measured = centre + rng.normal(0.0, GPS_NOISE_M, 3)
    exif = _exif(camera, number, measured)
    Image.fromarray(pixels).save(path, quality=JPEG_QUALITY, exif=exif)


def _vignetted(picture: Floats) -> Floats:
    height, width = picture.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    off_axis = np.hypot((x - width / 2) / width, (y - height / 2) / height)
    darker: Floats = picture * (1.0 - 0.22 * off_axis**2)[:, :, None]
    return darker


def _exif(camera: pycolmap.Camera, number: int, east_north_up: NDArray[np.float64]) -> Image.Exif:
    exif = Image.Exif()
    exif[Base.Make] = "sfm_front"
    exif[Base.Model] = "Rendered Drone"
    exif[Base.Orientation] = 1
    # The focal length over the picture's diagonal is the same for the equivalent on 35 mm film.
    share = camera.focal_length / float(np.hypot(camera.width, camera.height))
    taken_at = _FIRST_PHOTO_AT + timedelta(seconds=_SECONDS_BETWEEN_PHOTOS * number)
    exif.get_ifd(IFD.Exif).update(
        {
            Base.DateTimeOriginal: taken_at.strftime("%Y:%m:%d %H:%M:%S"),
            Base.FocalLength: IFDRational(round(share * _SENSOR_DIAGONAL_MM * 100), 100),
            Base.FocalLengthIn35mmFilm: round(share * _DIAGONAL_35MM),
            Base.ExifImageWidth: camera.width,
            Base.ExifImageHeight: camera.height,
        }
    )
    latitude, longitude, altitude = pycolmap.GPSTransform().enu_to_ellipsoid(
        east_north_up[None],
        ORIGIN_LATITUDE_DEG,
        ORIGIN_LONGITUDE_DEG,
        ORIGIN_ALTITUDE_M,
    )[0]
    exif.get_ifd(IFD.GPSInfo).update(
        {
            GPS.GPSVersionID: b"\x02\x03\x00\x00",
            GPS.GPSLatitudeRef: "N" if latitude >= 0 else "S",
            GPS.GPSLatitude: _degrees(latitude),
            GPS.GPSLongitudeRef: "E" if longitude >= 0 else "W",
            GPS.GPSLongitude: _degrees(longitude),
            GPS.GPSAltitudeRef: b"\x00",
            GPS.GPSAltitude: IFDRational(round(altitude * 1000), 1000),
        }
    )
    return exif


def _degrees(angle: float) -> tuple[IFDRational, IFDRational, IFDRational]:
    """Degrees, minutes and seconds, the last to a ten-thousandth: 3 mm on the ground."""
    ten_thousandths = round(abs(angle) * 3600 * 10_000)
    minutes, rest = divmod(ten_thousandths, 60 * 10_000)
    return (
        IFDRational(minutes // 60, 1),
        IFDRational(minutes % 60, 1),
        IFDRational(rest, 10_000),
    )
