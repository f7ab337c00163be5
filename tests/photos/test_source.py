"""Listing and ordering the photos of a folder."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from PIL import Image

from sfm_front.errors import ConfigError, InputError
from sfm_front.photos.source import list_photos, order_photos
from sfm_front.types import PhotoPath


def touch(folder: Path, *names: str) -> None:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x")


def names(photos: list[PhotoPath]) -> list[str]:
    return [photo.name for photo in photos]


def test_photos_are_listed_by_name_whatever_case_folder_or_script(tmp_path: Path) -> None:
    touch(tmp_path, "b.JPG", "a.jpeg", "sub/deep/c d.Png", "sub/ünïcødé 写真.tif", "x.TIFF")
    touch(tmp_path, "y.bmp", "z.WebP", "img10.jpg", "img2.jpg")
    photos = list_photos(tmp_path)
    assert names(photos) == [
        "a.jpeg",
        "b.JPG",
        "img10.jpg",
        "img2.jpg",
        "sub/deep/c d.Png",
        "sub/ünïcødé 写真.tif",
        "x.TIFF",
        "y.bmp",
        "z.WebP",
    ]
    assert all(photo.path == tmp_path / photo.name for photo in photos)


def test_other_and_hidden_files_are_passed_over(tmp_path: Path) -> None:
    touch(tmp_path, "a.jpg", ".hidden.jpg", ".trash/b.jpg", "._a.jpg", "notes.txt", "Thumbs.db")
    touch(tmp_path, ".DS_Store", "film.mp4", "gps.csv", "jpg", "c.jpg.part")
    assert names(list_photos(tmp_path)) == ["a.jpg"]


def test_an_output_folder_among_the_photos_is_left_out(tmp_path: Path) -> None:
    touch(tmp_path, "a.jpg", "out/sparse/render.png", "outer/b.jpg")
    assert names(list_photos(tmp_path, exclude=tmp_path / "out")) == ["a.jpg", "outer/b.jpg"]
    assert len(list_photos(tmp_path, exclude=tmp_path / "not there")) == 3


def test_links_are_followed_once(tmp_path: Path) -> None:
    touch(tmp_path, "photos/a.jpg", "photos/sub/c.jpg", "elsewhere/b.jpg")
    (tmp_path / "photos" / "loop").symlink_to(tmp_path / "photos")
    (tmp_path / "photos" / "sub" / "loop").symlink_to(tmp_path / "photos" / "sub")
    (tmp_path / "photos" / "more").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "elsewhere" / "back").symlink_to(tmp_path / "photos")
    assert names(list_photos(tmp_path / "photos")) == ["a.jpg", "more/b.jpg", "sub/c.jpg"]


def test_a_link_to_nowhere_is_listed_for_the_reader_to_report(tmp_path: Path) -> None:
    (tmp_path / "gone.jpg").symlink_to(tmp_path / "nowhere.jpg")
    assert names(list_photos(tmp_path)) == ["gone.jpg"]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names")
def test_names_that_are_not_utf8_become_distinct_text(tmp_path: Path) -> None:
    for raw in (b"\xe4.jpg", b"\xf6.jpg"):
        Path(os.fsdecode(os.path.join(os.fsencode(tmp_path), raw))).write_bytes(b"x")  # noqa: PTH118
    photos = list_photos(tmp_path)
    assert names(photos) == ["\\xe4.jpg", "\\xf6.jpg"]
    assert all(photo.path.exists() for photo in photos)


@pytest.mark.parametrize(
    ("name", "message"),
    [("missing", "no such folder"), ("file.jpg", "not a folder"), ("empty", "no photo in it")],
)
def test_a_folder_that_cannot_be_used_is_one_clear_line(
    tmp_path: Path, name: str, message: str
) -> None:
    touch(tmp_path, "file.jpg", "empty/readme.txt")
    with pytest.raises(InputError, match=message) as caught:
        list_photos(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)


def save_photo(folder: Path, name: str, captured_at: str | None) -> None:
    exif = Image.Exif()
    exif[0x0112] = 1  # Pillow drops an Exif without main tags.
    if captured_at is not None:
        exif.get_ifd(0x8769)[0x9003] = captured_at
    Image.new("RGB", (8, 8)).save(folder / name, exif=exif)


def test_order_by_time_puts_photos_without_one_last(tmp_path: Path) -> None:
    save_photo(tmp_path, "a.jpg", None)
    save_photo(tmp_path, "b.jpg", "2020:01:01 00:00:02")
    save_photo(tmp_path, "c.jpg", "2020:01:01 00:00:01")
    save_photo(tmp_path, "d.png", "2020:01:01 00:00:01")
    touch(tmp_path, "broken.jpg")
    photos = list_photos(tmp_path)
    assert names(order_photos(photos, "time")) == ["c.jpg", "d.png", "b.jpg", "a.jpg", "broken.jpg"]


def test_random_order_depends_on_the_seed_alone() -> None:
    photos = [PhotoPath(f"{i:02d}.jpg", Path(f"{i:02d}.jpg")) for i in range(30)]
    shuffled = order_photos(photos, "random", seed=3)
    assert sorted(names(shuffled)) == names(photos)
    assert names(shuffled) != names(photos)
    assert order_photos(reversed(photos), "random", seed=3) == shuffled
    assert order_photos(photos, "random", seed=4) != shuffled
    assert order_photos(shuffled) == photos


def test_an_unknown_order_is_refused() -> None:
    with pytest.raises(ConfigError, match="name, time, random"):
        order_photos([], "size")  # type: ignore[arg-type]
