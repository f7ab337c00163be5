"""What a report needs of a database, read without a trace."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.photo_stream import described, true_pair

from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.storage.database import PhotoDatabase
from sfm_front.storage.stored_session import read_stored_session
from sfm_front.types import Exif, GeoPosition, Skipped, SkipReason

HIGH, FLAT = GeoPosition(47.5, -8.25, 512.0), GeoPosition(47.5, -8.25)


@pytest.fixture(scope="module")
def scene():
    return make_scene(4, 300, seed=2)


@pytest.fixture
def database(tmp_path, scene):
    file = tmp_path / "database.db"
    with PhotoDatabase(file) as store:
        for index in range(3):
            pairs = [true_pair(scene, index, index - 1, (index + 1, index))] if index else []
            exif = Exif(position=FLAT if index == 2 else HIGH)
            photo = replace(described(scene, index), exif=exif)
            store.write(index + 1, photo, scene.camera, pairs, prior=HIGH if index == 0 else None)
        store.write_skipped(Skipped("x.jpg", SkipReason.EMPTY_FILE), Path("/photos/x.jpg"))
    return file


def test_it_is_what_was_written(database, scene):
    session = read_stored_session(database)
    assert [photo.image_id for photo in session.photos] == [1, 2, 3]
    assert session.unused == [Skipped("x.jpg", SkipReason.EMPTY_FILE)]
    assert session.skipped == {"x.jpg": Path("/photos/x.jpg")}
    assert session.cameras[1].params.tolist() == scene.camera.params.tolist()
    first, second = (true_pair(scene, i, i - 1, (i + 1, i)) for i in (1, 2))
    pairs = [[1, 2, first.num_inliers], [2, 3, second.num_inliers]]
    assert session.pairs.tolist() == pairs
    in_second = [first.two_view_geometry.inlier_matches[:, 0]]
    in_second.append(second.two_view_geometry.inlier_matches[:, 1])
    assert session.num_matched[1] == first.num_inliers
    assert session.num_matched[2] == len(np.unique(np.concatenate(in_second)))


def test_positions_are_priors_and_without_altitude_those_of_exif(database):
    # The second's altitude was in EXIF, but the session had found it unfit.
    assert read_stored_session(database).positions == {1: HIGH, 3: FLAT}


def test_reading_leaves_no_trace(database):
    before = database.read_bytes()
    read_stored_session(database)
    assert [path.name for path in database.parent.iterdir()] == ["database.db"]
    assert database.read_bytes() == before


def test_what_is_no_session_is_empty(tmp_path):
    for content in (None, b"", b"no database at all, but long enough to be read as one"):
        if content is not None:
            (tmp_path / "database.db").write_bytes(content)
        session = read_stored_session(tmp_path / "database.db")
        assert not session.photos
        assert session.pairs.shape == (0, 3)
