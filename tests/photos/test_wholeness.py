"""Telling whole files from those under way."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from helpers.photo_files import photo

from sfm_front.photos.wholeness import is_whole

FORMATS = ("JPEG", "PNG", "TIFF", "BMP", "WEBP")


def saved(folder: Path, kind: str) -> Path:
    path = folder / "a.jpg"
    photo(1, 0).save(path, kind)
    return path


@pytest.mark.parametrize("kind", FORMATS)
def test_a_file_is_whole_when_all_of_it_is_there(tmp_path: Path, kind: str) -> None:
    path = saved(tmp_path, kind)
    data = path.read_bytes()
    assert is_whole(path)
    for num_bytes in (0, 1, 11, 300, len(data) // 2, len(data) - 20):
        path.write_bytes(data[:num_bytes])
        assert not is_whole(path), num_bytes


@pytest.mark.parametrize("kind", FORMATS)
def test_space_taken_in_advance_is_not_the_photo(tmp_path: Path, kind: str) -> None:
    """Some programs give the file its full size before they write its content."""
    path = saved(tmp_path, kind)
    os.truncate(path, 0)
    os.truncate(path, 100_000)
    assert not is_whole(path)


@pytest.mark.parametrize("kind", FORMATS)
def test_what_follows_the_image_does_no_harm(tmp_path: Path, kind: str) -> None:
    path = saved(tmp_path, kind)
    with path.open("ab") as file:
        file.write(b"a film, as phones append it")
    assert is_whole(path)


def test_what_is_no_image_is_not_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    assert not is_whole(path)
    path.write_text("a page that says that the photo is not to be had")
    assert not is_whole(path)
    assert not is_whole(tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="no pipes with a name in a folder")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.jpg")
    assert not is_whole(tmp_path / "a.jpg")
