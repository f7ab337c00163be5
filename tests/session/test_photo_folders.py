"""Names and cameras of photos that come from several folders."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers.photo_stream import described

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.session.options import SessionOptions
from sfm_front.session.photo_folders import PhotoFolders
from sfm_front.session.resume import Newcomers
from sfm_front.session.session import Session
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import ExtractedPhoto, PhotoPath

NUM_PHOTOS = 4


def options(**changes: object) -> SessionOptions:
    return SessionOptions(**({"global_descriptor": "vlad", "threads": 1} | changes))


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 400, seed=1, layout="orbit", outlier_ratio=0.05)


@pytest.fixture(scope="module")
def photos(orbit) -> list[ExtractedPhoto]:
    return [described(orbit, index) for index in range(NUM_PHOTOS)]


def test_photos_at_the_top_of_folders_are_in_one_for_cameras(tmp_path):
    with PhotoDatabase(tmp_path / "database.db") as database:
        folders = PhotoFolders(database)
        assert folders.folder_of("a.jpg") == "."
        assert folders.folder_of("sub/a.jpg") == "sub"
        assert folders.prefix(tmp_path / "first", []) == ""
        assert folders.prefix(tmp_path / "sub", ["a.jpg", "sub/a.jpg"]) == "sub1/"
        assert folders.folder_of("sub1/a.jpg") == "."
        assert folders.folder_of("sub1/deeper/a.jpg") == "deeper"
        assert folders.folder_of("sub/a.jpg") == "sub"


def test_photos_without_exif_of_a_folder_that_is_added_share_the_camera(photos, tmp_path):
    """As if they had come in one folder; so they do when the session is gone on with."""
    for names in (["a.jpg", "b.jpg"], ["c.jpg"], ["d.jpg"]):
        with Session(tmp_path / "out", options(), resume=True) as session:
            where = tmp_path / names[0].removesuffix(".jpg")
            newcomers = Newcomers(session.database, where, tmp_path / "out", append=True)
            given = [PhotoPath(name, where / name) for name in names]
            for photo, source in zip(newcomers.among(given, print), photos, strict=False):
                session.add_extracted(replace(source, name=photo.name, digest=photo.name))
    with PhotoDatabase(tmp_path / "out" / "database.db") as database:
        assert [photo.name for photo in database.photos()] == [
            "a.jpg",
            "b.jpg",
            "c/c.jpg",
            "d/d.jpg",
        ]
        assert {photo.camera_id for photo in database.photos()} == {1}
