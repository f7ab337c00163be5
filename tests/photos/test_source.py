"""Listing and ordering the photos of a folder."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from helpers.locations import ROOT
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


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names")
def test_no_two_files_get_the_same_name(tmp_path: Path) -> None:
    raw_names = (
        b"\xe4.jpg",
        rb"\xe4.jpg",  # Spelled as the one above is escaped.
        rb"\x5cxe4.jpg",  # And as this one is escaped in turn.
        b"\\xe4\xf6.jpg",
        b"\xe4\\xf6.jpg",
        rb"back\slash.jpg",
    )
    for raw in raw_names:
        Path(os.fsdecode(os.path.join(os.fsencode(tmp_path), raw))).write_bytes(b"x")  # noqa: PTH118
    photos = list_photos(tmp_path)
    assert len(set(names(photos))) == len({photo.path for photo in photos}) == len(raw_names)
    assert {"\\xe4.jpg", "back\\slash.jpg"} < set(names(photos))
    for name in names(photos):
        name.encode()


def refuse(monkeypatch: pytest.MonkeyPatch, *folders: Path) -> None:
    """Deny search permission for these folders, as mode 444 does to all users but root."""
    stat = os.stat

    def guarded(path: str | Path, **options: Any) -> os.stat_result:
        if any(folder in Path(path, "x").parents for folder in folders):
            raise PermissionError(13, "Permission denied", str(path))
        return stat(path, **options)

    monkeypatch.setattr(os, "stat", guarded)


def test_a_sub_folder_that_cannot_be_searched_is_named_and_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    touch(tmp_path, "a.jpg", "locked/b.jpg", "z/c.jpg")
    refuse(monkeypatch, tmp_path / "locked")
    assert names(list_photos(tmp_path)) == ["a.jpg", "z/c.jpg"]
    assert caplog.messages == [f"passed over {tmp_path / 'locked'}: Permission denied"]


def test_many_folders_that_cannot_be_searched_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    locked = [tmp_path / f"{number:02d}" for number in range(13)]
    touch(tmp_path, "a.jpg", *(f"{folder.name}/b.jpg" for folder in locked))
    refuse(monkeypatch, *locked)
    assert names(list_photos(tmp_path)) == ["a.jpg"]
    assert len(caplog.messages) == 11
    assert caplog.messages[-1] == "passed over 3 more folders that cannot be read"


def test_where_no_folder_can_be_searched_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    touch(tmp_path, "locked/b.jpg")
    with monkeypatch.context() as patch:
        refuse(patch, tmp_path / "locked")
        with pytest.raises(InputError, match=r"no photo in it .* that can be read \(1 cannot\)"):
            list_photos(tmp_path)
    refuse(monkeypatch, tmp_path)
    with pytest.raises(InputError, match=r"cannot be read \(Permission denied\)"):
        list_photos(tmp_path)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs root")
def test_permissions_bind_other_users() -> None:
    """The same on the file system itself, as a user whom mode 444 binds."""
    with TemporaryDirectory() as parent:
        Path(parent).chmod(0o755)
        touch(Path(parent), "open/a.jpg", "open/locked/b.jpg", "closed/c.jpg", "unlisted/d.jpg")
        for name, mode in (("open/locked", 0o444), ("closed", 0o444), ("unlisted", 0o711)):
            (Path(parent) / name).chmod(mode)
        done = list_as_nobody(Path(parent), "open", "closed", "unlisted")
    denied = "cannot be read (Permission denied). Give a folder that you may read and enter."
    assert done.stdout.splitlines() == ["['a.jpg']", f"closed: {denied}", f"unlisted: {denied}"]
    assert done.stderr == "passed over open/locked: Permission denied\n"


def list_as_nobody(parent: Path, *folders: str) -> subprocess.CompletedProcess[str]:
    code = (
        "import logging, os, pathlib, sys\n"
        "from sfm_front.errors import InputError\n"
        "from sfm_front.photos.source import list_photos\n"
        "os.setgroups([])\n"
        "os.setgid(65534)\n"
        "os.setuid(65534)\n"
        "for folder in sys.argv[1:]:\n"
        "    try: print([photo.name for photo in list_photos(pathlib.Path(folder))])\n"
        "    except InputError as error: print(error)\n"
    )
    return subprocess.run(
        [sys.executable, "-c", code, *folders],
        cwd=parent,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have other limits")
def test_folders_nested_beyond_the_longest_path_are_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    photos = tmp_path / "photos"
    touch(photos, "z.jpg")
    monkeypatch.chdir(photos)
    for _ in range(1050):
        os.mkdir("ddd")  # noqa: PTH102
        os.chdir("ddd")
    try:
        Path("too far.jpg").write_bytes(b"x")
        assert names(list_photos(photos)) == ["z.jpg"]
    finally:  # In steps: Python's own rmtree recurses.
        Path("too far.jpg").unlink()
        for _ in range(1050):
            os.chdir("..")
            os.rmdir("ddd")  # noqa: PTH106
    (message,) = caplog.messages
    assert message.startswith(f"passed over {photos / 'ddd' / 'ddd'}")
    assert message.endswith("File name too long")


def test_a_path_longer_than_the_longest_is_one_line(tmp_path: Path) -> None:
    touch(tmp_path, "a.jpg")
    long = tmp_path / "/".join(["x" * 200] * 30)
    with pytest.raises(InputError, match="File name too long"):
        list_photos(long)
    assert names(list_photos(tmp_path, exclude=long)) == ["a.jpg"]


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
