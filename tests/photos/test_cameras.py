"""Which photos share a camera, and the focal length it starts from."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from sfm_front.errors import ConfigError
from sfm_front.photos.cameras import CameraCatalog, CameraOptions, focal_prior_px
from sfm_front.photos.exif import FULL_FRAME_DIAGONAL_MM
from sfm_front.photos.reader import PhotoReader
from sfm_front.types import Exif, Photo

PHONE = Exif(make="Maker", model="Phone", focal_length_mm=4.0, focal_length_35mm=28.0)
NO_EXIF = Exif()
PHOTOS_PER_SIZE = CameraOptions().photos_per_size


def photo(name: str, size: tuple[int, int] = (400, 300), exif: Exif = PHONE) -> Photo:
    pixels = np.zeros((1, 1, 3), np.uint8)
    return Photo(name, Path(name), pixels, *size, digest=name, exif=exif)


def ids(catalog: CameraCatalog, photos: list[Photo]) -> list[int]:
    return [catalog.camera_for(each).camera_id for each in photos]


def test_photos_of_one_camera_share_it() -> None:
    catalog = CameraCatalog()
    first = catalog.camera_for(photo("a.jpg"))
    again = catalog.camera_for(photo("other/b.jpg"))
    assert (first.camera_id, first.is_new) == (1, True)
    assert (again.camera_id, again.is_new) == (1, False)
    assert again.camera is first.camera
    assert (first.camera.width, first.camera.height) == (400, 300)


@pytest.mark.parametrize(
    "other",
    [
        photo("b.jpg", (300, 400)),
        photo("b.jpg", (800, 600)),
        photo("b.jpg", exif=replace(PHONE, make="Other")),
        photo("b.jpg", exif=replace(PHONE, model="Other")),
        photo("b.jpg", exif=replace(PHONE, focal_length_mm=5.0)),
        photo("b.jpg", exif=replace(PHONE, focal_length_35mm=35.0)),
        photo("b.jpg", exif=NO_EXIF),
    ],
)
def test_another_camera_focal_length_or_size_is_not_shared(other: Photo) -> None:
    assert ids(CameraCatalog(), [photo("a.jpg"), other, photo("c.jpg")]) == [1, 2, 1]


def test_a_folder_of_one_size_without_exif_is_one_camera() -> None:
    frames = [photo(f"x/{i:04d}.png", exif=NO_EXIF) for i in range(20)]
    other_folder = [photo(f"y/{i:04d}.png", exif=NO_EXIF) for i in range(3)]
    assert ids(CameraCatalog(), frames + other_folder) == [1] * 20 + [2] * 3


def test_turned_photos_of_such_a_folder_are_a_second_camera() -> None:
    wide = [photo(f"{i}.png", exif=NO_EXIF) for i in range(3)]
    tall = [photo(f"{i}t.png", (300, 400), exif=NO_EXIF) for i in range(3)]
    assert ids(CameraCatalog(), wide + tall) == [1] * 3 + [2] * 3


def test_photos_of_many_sizes_without_exif_share_nothing() -> None:
    """As from the internet: two of equal size are so by chance."""
    photos = [photo(f"{i}.jpg", (1000 + i, 700), exif=NO_EXIF) for i in range(30)]
    photos += [photo(f"{i} again.jpg", (1000 + i, 700), exif=NO_EXIF) for i in range(10)]
    assert len(set(ids(CameraCatalog(), photos))) == 40


def test_one_odd_size_does_not_end_the_sharing() -> None:
    frames = [photo(f"{i:04d}.png", exif=NO_EXIF) for i in range(2 * PHOTOS_PER_SIZE)]
    odd = photo("0010 cover.png", (500, 500), exif=NO_EXIF)
    chosen = ids(CameraCatalog(), [*frames[:PHOTOS_PER_SIZE], odd, *frames[PHOTOS_PER_SIZE:]])
    assert chosen[PHOTOS_PER_SIZE] == 2
    assert chosen.count(1) == len(frames)


@pytest.mark.parametrize(("photos_per_size", "expected"), [(3, [1, 1, 2, 2]), (4, [1, 1, 2, 3])])
def test_a_second_size_is_shared_once_there_are_enough_photos(
    photos_per_size: int, expected: list[int]
) -> None:
    photos = [photo(f"{i}.png", exif=NO_EXIF) for i in range(2)]
    photos += [photo(f"{i} odd.png", (500, 500), exif=NO_EXIF) for i in range(2)]
    catalog = CameraCatalog(CameraOptions(photos_per_size=photos_per_size))
    assert ids(catalog, photos) == expected


SHARING_PHOTOS = [
    photo("x/a.jpg"),
    photo("x/b.jpg", exif=NO_EXIF),
    photo("y/c.jpg", exif=replace(PHONE, model="Other")),
    photo("y/d.jpg", (300, 400)),
    photo("y/e.jpg"),
]


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        ("auto", [1, 2, 3, 4, 1]),
        ("single", [1, 1, 1, 2, 1]),
        ("per-folder", [1, 1, 2, 3, 2]),
        ("per-image", [1, 2, 3, 4, 5]),
    ],
)
def test_modes(mode: str, expected: list[int]) -> None:
    options = CameraOptions(mode=mode)  # type: ignore[arg-type]
    assert ids(CameraCatalog(options), SHARING_PHOTOS) == expected


@pytest.mark.parametrize("stop", range(1, 12))
def test_a_resumed_catalog_goes_on_as_if_it_had_not_stopped(stop: int) -> None:
    photos = [*SHARING_PHOTOS, *(photo(f"x/{i}.jpg", exif=NO_EXIF) for i in range(3))]
    photos += [photo(f"x/{i}w.jpg", (500 + i, 300), exif=NO_EXIF) for i in range(4)]
    expected = ids(CameraCatalog(), photos)
    before, after = CameraCatalog(), CameraCatalog()
    for each in photos[:stop]:
        after.remember(each, before.camera_for(each).camera)
    assert ids(after, photos[stop:]) == expected[stop:]


def test_nothing_known_gives_no_prior() -> None:
    camera = CameraCatalog().camera_for(photo("a.jpg", exif=NO_EXIF)).camera
    assert not camera.has_prior_focal_length
    assert camera.params.tolist() == pytest.approx([1.2 * 400, 200, 150, 0])


def test_the_35_mm_equivalent_gives_the_prior() -> None:
    camera = CameraCatalog().camera_for(photo("a.jpg")).camera
    assert camera.has_prior_focal_length
    assert camera.model_name == "SIMPLE_RADIAL"
    assert camera.focal_length == pytest.approx(28.0 / FULL_FRAME_DIAGONAL_MM * 500)


@pytest.mark.parametrize("focal_35mm", [0.5, 1e6])
def test_an_absurd_focal_length_is_no_prior(focal_35mm: float) -> None:
    absurd = photo("a.jpg", exif=replace(PHONE, focal_length_35mm=focal_35mm))
    assert focal_prior_px(absurd, CameraOptions()) is None
    assert not CameraCatalog().camera_for(absurd).camera.has_prior_focal_length


@pytest.mark.parametrize("limits", [{"min_focal_factor": 0.9}, {"max_focal_factor": 0.7}])
def test_what_is_plausible_is_an_option(limits: dict[str, float]) -> None:
    """The phone's focal length is 0.81 of the long side."""
    assert focal_prior_px(photo("a.jpg"), CameraOptions()) is not None
    assert focal_prior_px(photo("a.jpg"), CameraOptions(**limits)) is None  # type: ignore[arg-type]
    camera = CameraCatalog(CameraOptions(**limits)).camera_for(photo("a.jpg")).camera  # type: ignore[arg-type]
    assert not camera.has_prior_focal_length


def saved(path: Path, make: str, model: str, focal_mm: float) -> Photo:
    exif = Image.Exif()
    exif[0x010F], exif[0x0110] = make, model
    exif.get_ifd(0x8769)[0x920A] = IFDRational(focal_mm)
    Image.new("RGB", (400, 300)).save(path, exif=exif)
    read = PhotoReader().read(path, path.name)
    assert isinstance(read, Photo)
    return read


def test_the_camera_database_knows_sensor_widths(tmp_path: Path) -> None:
    """A Canon EOS 5D Mark II has a sensor 36 mm wide."""
    known = saved(tmp_path / "a.jpg", "Canon", "Canon EOS 5D Mark II", 30.0)
    assert focal_prior_px(known, CameraOptions()) == pytest.approx(400 * 30 / 36, rel=0.01)
    assert (
        focal_prior_px(saved(tmp_path / "b.jpg", "Nobody", "Nothing", 30.0), CameraOptions())
        is None
    )


def test_a_format_that_pycolmap_cannot_read_has_no_prior(tmp_path: Path) -> None:
    webp = saved(tmp_path / "a.webp", "Canon", "Canon EOS 5D Mark II", 30.0)
    assert focal_prior_px(webp, CameraOptions()) is None


def test_shrinking_a_photo_keeps_its_field_of_view(tmp_path: Path) -> None:
    """EXIF of a 24 mm wide sensor of 4000 pixels, 30 mm lens, in a photo of 400 pixels: COLMAP
    itself takes the focal length of the 4000 pixels."""
    exif = Image.Exif()
    per_inch = 4000 / 24 * 25.4
    exif.get_ifd(0x8769).update(
        {0x920A: 30.0, 0xA20E: per_inch, 0xA20F: per_inch, 0xA210: 2, 0xA002: 4000, 0xA003: 3000}
    )
    Image.new("RGB", (400, 300)).save(tmp_path / "a.jpg", exif=exif)
    read = PhotoReader().read(tmp_path / "a.jpg", "a.jpg")
    assert isinstance(read, Photo)
    assert focal_prior_px(read, CameraOptions()) == pytest.approx(400 * 30 / 24, rel=1e-4)


@pytest.mark.parametrize("model", ["PINHOLE", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV"])
def test_any_camera_model(model: str) -> None:
    camera = CameraCatalog(CameraOptions(model=model)).camera_for(photo("a.jpg")).camera
    assert camera.model_name == model
    assert camera.has_prior_focal_length
    assert camera.focal_length_x == camera.focal_length_y == pytest.approx(28 / 43.27 * 500)
    assert (camera.principal_point_x, camera.principal_point_y) == (200, 150)
    assert camera.verify_params()


def test_known_calibration_holds_for_photos_of_the_first_size() -> None:
    options = CameraOptions(model="PINHOLE", params=(410.0, 420.0, 201.0, 149.0))
    catalog = CameraCatalog(options)
    camera = catalog.camera_for(photo("a.jpg", exif=NO_EXIF)).camera
    assert camera.params.tolist() == [410, 420, 201, 149]
    assert camera.has_prior_focal_length
    turned = catalog.camera_for(photo("b.jpg", (300, 400), exif=NO_EXIF)).camera
    assert turned.params.tolist() == pytest.approx([480, 480, 150, 200])
    assert not turned.has_prior_focal_length


def test_calibration_of_another_size_is_refused() -> None:
    options = CameraOptions(model="PINHOLE", params=(4100.0, 4200.0, 2010.0, 1490.0))
    with pytest.raises(ConfigError, match=r"principal point at \(2010.0, 1490.0\).*a.jpg"):
        CameraCatalog(options).camera_for(photo("a.jpg"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mode": "automatic"}, "auto, single, per-folder, per-image"),
        ({"model": "RADIAL_SIMPLE"}, "SIMPLE_RADIAL.*got RADIAL_SIMPLE"),
        ({"model": "INVALID"}, "got INVALID"),
        ({"model": "PINHOLE", "params": (1.0, 2.0, 3.0)}, r"4 numbers \(fx, fy, cx, cy\), got 3"),
        ({"params": (1.0, 2.0, 3.0, math.nan)}, "finite"),
        ({"params": (-500.0, 200.0, 150.0, 0.0)}, r"\(f, cx, cy, k\): focal lengths.*above 0"),
        ({"photos_per_size": 0}, "photos_per_size must be at least 1, got 0"),
        ({"min_focal_factor": 0.0}, "min_focal_factor must be above 0, got 0.0"),
        ({"min_focal_factor": math.nan}, "min_focal_factor must be above 0, got nan"),
        (
            {"max_focal_factor": 0.1},
            r"max_focal_factor must be above min_focal_factor \(0.1\), got 0.1",
        ),
    ],
)
def test_wrong_options_are_refused_when_built(options: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        CameraOptions(**options)  # type: ignore[arg-type]
