"""Photos of a session, read without a trace."""

from __future__ import annotations

import os
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.photo_stream import described

from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.storage.database import PhotoDatabase
from sfm_front.storage.session_photos import read_photos
from sfm_front.types import Exif, GeoPosition


@pytest.fixture
def database(tmp_path):
    scene = make_scene(12, 50, seed=2, layout="orbit")
    file = tmp_path / "ein ordner?" / "database.db"
    file.parent.mkdir()
    position = Exif(position=GeoPosition(47.5, -8.25, 512.0))
    with PhotoDatabase(file) as store:
        first = replace(described(scene, 0), name="a b.jpg", path=Path("/photos/a b.jpg"))
        store.write(1, first, scene.camera, [])
        store.write(2, replace(described(scene, 1), exif=position), scene.camera, [])
    return file


def test_photos_are_those_of_the_session(database, monkeypatch):
    monkeypatch.chdir(database.parent)
    for file in (database, Path("database.db")):
        first, second = read_photos(file)
        assert (first.name, first.path) == ("a b.jpg", Path("/photos/a b.jpg"))
        assert second.exif.position == GeoPosition(47.5, -8.25, 512.0)


def test_reading_leaves_no_trace(database):
    before = database.read_bytes()
    read_photos(database)
    assert [path.name for path in database.parent.iterdir()] == ["database.db"]
    assert database.read_bytes() == before


@pytest.mark.skipif(os.getuid() == 0, reason="root may write anywhere")
def test_a_folder_that_nobody_can_write_to_is_read(database):
    database.parent.chmod(0o500)
    try:
        assert len(read_photos(database)) == 2
    finally:
        database.parent.chmod(0o700)


def test_what_is_no_session_has_no_photos(tmp_path):
    assert read_photos(tmp_path / "database.db") is None
    (tmp_path / "database.db").write_bytes(b"no database at all, but long enough to be read as one")
    assert read_photos(tmp_path / "database.db") is None
    (tmp_path / "other.db").touch()
    with sqlite3.connect(tmp_path / "other.db") as connection:
        connection.execute("CREATE TABLE images (image_id INTEGER)")
    assert read_photos(tmp_path / "other.db") is None
    assert not (tmp_path / "nowhere.db").exists()
