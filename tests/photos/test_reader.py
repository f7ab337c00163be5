"""Reading photos: files that are none, limits of size, digests and duplicates."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from helpers.image_making import encoded, read, read_photo, scene
from PIL import Image

from sfm_front.errors import ConfigError
from sfm_front.photos.duplicates import DuplicateFinder
from sfm_front.photos.exif import read_exif
from sfm_front.photos.reader import PhotoReader, file_digest
from sfm_front.types import Exif, Photo, Skipped, SkipReason


def make_missing(path: Path) -> None:
    path.unlink(missing_ok=True)


def make_folder(path: Path) -> None:
    path.mkdir()


def make_broken_link(path: Path) -> None:
    path.symlink_to("nowhere.jpg")


def make_pipe(path: Path) -> None:
    os.mkfifo(path)


Look = Callable[[Path, str], Photo | str | Skipped]
looks = pytest.mark.parametrize("look", [PhotoReader().read, file_digest])


@looks
@pytest.mark.parametrize(
    "make",
    [
        make_missing,
        make_folder,
        make_broken_link,
        pytest.param(
            make_pipe,
            marks=pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no such files"),
        ),
    ],
)
def test_what_is_no_file_is_unreadable(
    tmp_path: Path, make: Callable[[Path], None], look: Look
) -> None:
    make(tmp_path / "x.jpg")
    skipped = look(tmp_path / "x.jpg", "x.jpg")
    assert isinstance(skipped, Skipped)
    assert skipped.reason is SkipReason.UNREADABLE
    assert skipped.detail


@looks
@pytest.mark.parametrize(
    ("error", "detail"),
    [
        (PermissionError(13, "Permission denied"), "Permission denied"),
        (MemoryError(), "MemoryError"),
    ],
)
def test_what_cannot_be_read_is_unreadable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, look: Look, error: Exception, detail: str
) -> None:
    (tmp_path / "x.jpg").write_bytes(b"x")

    def refuse(_path: Path, _mode: str) -> None:
        raise error

    monkeypatch.setattr(Path, "open", refuse)
    assert look(tmp_path / "x.jpg", "x.jpg") == Skipped("x.jpg", SkipReason.UNREADABLE, detail)


@pytest.fixture
def hanging(tmp_path: Path) -> Iterator[Path]:
    """A file that gives nothing until the test is over, to whom stat says that it is regular."""
    path = tmp_path / "x.jpg"
    os.mkfifo(path)
    is_regular = stat.S_ISREG
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stat, "S_ISREG", lambda mode: stat.S_ISFIFO(mode) or is_regular(mode))
        yield path
    os.close(os.open(path, os.O_RDWR))  # Lets the reader that waits go on.


def test_a_file_that_hangs_is_given_up(hanging: Path) -> None:
    assert PhotoReader(timeout_s=0.01).read(hanging, "x.jpg") == Skipped(
        "x.jpg", SkipReason.UNREADABLE, "no answer within 0.01 s"
    )


def test_a_pipe_behind_a_link_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "x.jpg").symlink_to("pipe")
    assert PhotoReader().read(tmp_path / "x.jpg", "x.jpg") == Skipped(
        "x.jpg", SkipReason.UNREADABLE, "not a regular file"
    )
    assert read_exif(tmp_path / "x.jpg") == Exif()


@pytest.mark.parametrize("timeout_s", [0.0, float("nan")])
def test_a_time_limit_that_cannot_be_is_refused(timeout_s: float) -> None:
    with pytest.raises(ConfigError, match="timeout_s must be above 0"):
        PhotoReader(timeout_s=timeout_s)


@looks
def test_a_path_that_cannot_be_is_unreadable(look: Look) -> None:
    skipped = look(Path("null\0byte.jpg"), "x.jpg")
    assert isinstance(skipped, Skipped)
    assert skipped.reason is SkipReason.UNREADABLE


def test_the_digest_is_the_photos(tmp_path: Path) -> None:
    photo = read_photo(tmp_path, encoded(Image.fromarray(scene()), "PNG"))
    assert file_digest(photo.path, photo.name) == photo.digest
    assert len(photo.digest) == 32


def test_too_small_goes_by_the_short_side_of_the_file(tmp_path: Path) -> None:
    skipped = read(tmp_path, encoded(Image.fromarray(scene(300, 63)), "PNG"))
    assert isinstance(skipped, Skipped)
    assert skipped.reason is SkipReason.TOO_SMALL
    assert "300 x 63" in skipped.detail
    read_photo(tmp_path, encoded(Image.fromarray(scene(300, 64)), "PNG"))


@pytest.mark.parametrize(
    "options", [{"min_image_size": 0}, {"min_image_size": 100, "max_image_size": 99}]
)
def test_impossible_sizes_are_refused(options: dict[str, int]) -> None:
    with pytest.raises(ConfigError, match="image_size must be at least"):
        PhotoReader(**options)


def test_duplicates_are_byte_for_byte(tmp_path: Path) -> None:
    data = encoded(Image.fromarray(scene()), "PNG")
    first, copy = read_photo(tmp_path, data), read_photo(tmp_path, data)
    other = read_photo(tmp_path, encoded(Image.fromarray(scene()), "PNG", compress_level=1))
    finder = DuplicateFinder()
    assert finder.check("1.png", first.digest) is None
    assert finder.check("other.png", other.digest) is None
    assert finder.check("2.png", copy.digest) == Skipped(
        "2.png", SkipReason.DUPLICATE, "same file as 1.png"
    )
    assert finder.check("1.png", first.digest) is None


def test_duplicates_of_an_earlier_session_are_found() -> None:
    finder = DuplicateFinder({"abc": "old.jpg"})
    assert finder.check("new.jpg", "abc") is not None
    assert finder.check("old.jpg", "abc") is None
