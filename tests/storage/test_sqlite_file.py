"""What becomes of a database that is damaged, full, locked or gone, and what is told of it."""

from __future__ import annotations

import os
import sqlite3
import threading
from contextlib import closing

import pytest
from helpers.photo_stream import described

from sfm_front.errors import StorageError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.storage.database import PhotoDatabase


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(12, 200, seed=2, layout="orbit")


def test_a_file_that_is_no_database_is_told_in_one_line(tmp_path):
    (tmp_path / "database.db").write_bytes(b"no database" * 100)
    with pytest.raises(StorageError, match=r"database\.db: file is not a database"):
        PhotoDatabase(tmp_path / "database.db")


def test_a_database_locked_for_a_while_is_waited_for(orbit, tmp_path, caplog):
    file = tmp_path / "database.db"
    with (
        PhotoDatabase(file) as store,
        closing(sqlite3.connect(file, timeout=0, check_same_thread=False)) as other,
    ):
        other.isolation_level = None
        other.execute("BEGIN IMMEDIATE")
        threading.Timer(1.5, other.execute, ["ROLLBACK"]).start()
        store.write(1, described(orbit, 0), orbit.camera, [])
        assert "locked by another program" in caplog.text
        assert len(list(store.photos())) == 1


def test_a_full_disk_is_told_and_leaves_nothing_of_the_photo(orbit, tmp_path):
    file = tmp_path / "database.db"
    with PhotoDatabase(file) as store:
        store.write(1, described(orbit, 0), orbit.camera, [])
        pages = store._file.rows("PRAGMA page_count")[0][0]
        store._file.rows(f"PRAGMA max_page_count={pages + 5}")
        with pytest.raises(StorageError, match="full"):
            store.write(2, described(orbit, 1), orbit.camera, [])
        assert [photo.image_id for photo in store.photos()] == [1]
        store._file.rows("PRAGMA max_page_count=1000000")
        store.write(2, described(orbit, 1), orbit.camera, [])
        assert [photo.image_id for photo in store.photos()] == [1, 2]


def test_a_database_that_was_removed_is_not_written_to(orbit, tmp_path):
    if os.name == "nt":
        pytest.skip("Windows does not remove open files")
    file = tmp_path / "database.db"
    with PhotoDatabase(file) as store:
        file.unlink()
        with pytest.raises(StorageError, match="was removed"):
            store.write(1, described(orbit, 0), orbit.camera, [])


def test_a_database_that_another_program_holds_for_itself_is_told(orbit, tmp_path):
    file = tmp_path / "database.db"
    with PhotoDatabase(file) as store:
        store.write(1, described(orbit, 0), orbit.camera, [])
    other = sqlite3.connect(file, isolation_level=None)
    other.execute("PRAGMA locking_mode=EXCLUSIVE")
    other.execute("BEGIN EXCLUSIVE")
    with pytest.raises(StorageError, match=r"is locked.*goes on from here once that is mended"):
        PhotoDatabase(file)
    other.close()
    with PhotoDatabase(file) as store:
        assert store.num_photos() == 1
