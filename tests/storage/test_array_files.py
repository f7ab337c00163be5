"""Arrays on disk: round trip, damage, atomic writing, tidying up."""

from __future__ import annotations

import numpy as np
import pytest

from sfm_front.errors import InputError
from sfm_front.storage.array_files import ArrayFiles
from sfm_front.storage.atomic import write_atomically

KEY, OTHER = "0" * 31 + "a", "f" * 32


@pytest.fixture
def files(tmp_path) -> ArrayFiles:
    files = ArrayFiles(tmp_path / "arrays")
    files.save(KEY, {"a": np.arange(5, dtype=np.float32), "b": np.zeros((0, 4), np.uint8)})
    return files


def test_what_is_saved_is_loaded(files):
    loaded = files.load(KEY)
    np.testing.assert_array_equal(loaded["a"], np.arange(5, dtype=np.float32))
    assert loaded["a"].dtype == np.float32
    assert loaded["b"].shape == (0, 4)
    assert files.has(KEY)


def test_what_was_never_saved_is_none(files):
    assert files.load(OTHER) is None
    assert not files.has(OTHER)


@pytest.mark.parametrize("damage", ["cut", "empty", "text", "flipped", "pickled"])
def test_a_damaged_file_is_none(files, tmp_path, damage):
    path = tmp_path / "arrays" / f"{KEY}.npz"
    data = bytearray(path.read_bytes())
    if damage == "cut":
        path.write_bytes(data[: len(data) // 2])
    elif damage == "empty":
        path.write_bytes(b"")
    elif damage == "text":
        path.write_text("not an archive")
    elif damage == "flipped":
        at = data.index(np.arange(5, dtype=np.float32).tobytes())
        data[at + 6] ^= 255
        path.write_bytes(data)
    else:
        np.savez(path, a=np.array([{"code": "any"}], dtype=object), allow_pickle=True)
    assert files.load(KEY) is None


def test_only_its_own_files_are_removed(files, tmp_path):
    files.save(OTHER, {"a": np.zeros(1)})
    foreign = tmp_path / "arrays" / "holiday.npz"
    foreign.write_bytes(b"mine")
    files.keep_only([OTHER])
    assert not files.has(KEY)
    assert files.has(OTHER)
    assert foreign.exists()


def test_a_file_whose_writing_fails_stays_as_it_was(tmp_path):
    path = tmp_path / "folder" / "a.bin"
    write_atomically(path, lambda file: file.write(b"before"))

    def fail(file):
        file.write(b"half")
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_atomically(path, fail)
    assert path.read_bytes() == b"before"
    assert list(path.parent.iterdir()) == [path]


def test_a_place_that_cannot_be_written_is_told_in_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file.*cannot be written \(.*\)") as error:
        write_atomically(tmp_path / "file" / "a.bin", lambda file: file.write(b""))
    assert "\n" not in str(error.value)
