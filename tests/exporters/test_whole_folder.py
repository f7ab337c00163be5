"""A folder is written whole or not at all, and never over another."""

from __future__ import annotations

import errno
import os

import pytest

from sfm_front.errors import InputError, StorageError
from sfm_front.exporters.whole_folder import whole_folder


def test_it_appears_when_all_of_it_is_written(tmp_path):
    folder = tmp_path / "deep" / "er"
    with whole_folder(folder) as fresh:
        (fresh / "sub").mkdir()
        (fresh / "sub" / "file").write_text("all")
        assert not folder.exists()
    assert (folder / "sub" / "file").read_text() == "all"
    assert list(folder.parent.iterdir()) == [folder]
    assert folder.stat().st_mode & 0o777 == 0o755


def write_and_raise(folder, error):
    with whole_folder(folder) as fresh:
        (fresh / "file").write_text("part")
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt, InputError])
def test_nothing_remains_where_writing_ends_early(tmp_path, error):
    with pytest.raises(error):
        write_and_raise(tmp_path / "out", error())
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_told_in_one_line(tmp_path):
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with pytest.raises(StorageError, match=r"out: cannot be written \(No space left"):
        write_and_raise(tmp_path / "out", full)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["file", "folder", "link"])
def test_what_is_there_stays(tmp_path, kind):
    place = tmp_path / "out"
    if kind == "file":
        place.write_text("kept")
    elif kind == "folder":
        place.mkdir()
        (place / "file").write_text("kept")
    else:
        place.symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="is there already"), whole_folder(place):
        pytest.fail("nothing may be written")
    assert list(tmp_path.iterdir()) == [place]


def test_an_empty_folder_is_filled(tmp_path):
    (tmp_path / "out").mkdir()
    with whole_folder(tmp_path / "out") as fresh:
        (fresh / "file").touch()
    assert list((tmp_path / "out").iterdir()) == [tmp_path / "out" / "file"]


def test_a_place_that_cannot_be_is_told(tmp_path):
    (tmp_path / "file").touch()
    with (
        pytest.raises(InputError, match="Give another --output"),
        whole_folder(tmp_path / "file/out"),
    ):
        pytest.fail("there is no such place")
