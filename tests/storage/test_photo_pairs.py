"""One photo of a database: its file, its pairs, its matches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.photo_stream import described, true_matches, true_pair

from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.storage.database import PhotoDatabase
from sfm_front.storage.photo_pairs import num_inliers, photo_file, verified_matches
from sfm_front.types import Skipped, SkipReason


@pytest.fixture(scope="module")
def scene():
    return make_scene(4, 300, seed=1)


@pytest.fixture
def database(scene, tmp_path):
    file = tmp_path / "database.db"
    with PhotoDatabase(file) as database:
        for index in range(3):
            photo = replace(described(scene, index), path=tmp_path / f"{index}.jpg")
            pairs = [true_pair(scene, index, 0, (index + 1, 1))] if index == 2 else []
            database.write(index + 1, photo, scene.camera, pairs)
        database.write_skipped(Skipped("bad.jpg", SkipReason.EMPTY_FILE), tmp_path / "bad.jpg")
    return file


def test_files_are_found_by_name(database, scene, tmp_path):
    assert photo_file(database, described(scene, 1).name) == tmp_path / "1.jpg"
    assert photo_file(database, "bad.jpg") == tmp_path / "bad.jpg"
    assert photo_file(database, "' OR 1=1 --") is None
    assert photo_file(tmp_path / "none.db", "bad.jpg") is None


@pytest.mark.parametrize(("one", "two"), [(3, 1), (1, 3)])
def test_matches_are_those_of_the_pair_either_way(database, scene, one, two):
    count = len(true_matches(scene, 2, 0))
    assert num_inliers(database, one, [1, 2, 3]) == {two: count}
    found = verified_matches(database, one, two)
    keypoints = [scene.photo(i - 1).features.keypoints[:, :2] for i in (one, two)]
    matches = true_matches(scene, one - 1, two - 1)
    expected = {(*keypoints[0][i].tolist(), *keypoints[1][j].tolist()) for i, j in matches.tolist()}
    assert {tuple(row) for row in np.hstack([found.xy1, found.xy2]).tolist()} == expected
    assert found.sizes == ((scene.camera.width, scene.camera.height),) * 2


def test_a_pair_that_is_not_verified_has_none(database):
    assert verified_matches(database, 1, 2) is None
    assert num_inliers(database, 2, [1, 3]) == {}
