"""A folder's index: made once, kept up with the folder, and made anew where it cannot be used."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from helpers import photo_files

from sfm_front.errors import InputError
from sfm_front.features.cached_extraction import CachedExtraction
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.features.sift import SiftExtractor, SiftOptions
from sfm_front.photos.reader import PhotoReader
from sfm_front.photos.source import list_photos
from sfm_front.search.photo_index import PhotoIndex, Update
from sfm_front.types import Skipped, SkipReason

NAMES = ("1_0.png", "1_60.png", "2_0.png", "sub/2_70.png")


@pytest.fixture
def folder(tmp_path) -> Path:
    photo_files.save(tmp_path / "photos", *NAMES)
    return tmp_path / "photos"


def update(folder: Path, *, max_features: int = 200) -> tuple[PhotoIndex, Update]:
    location = folder.parent / "index"
    describer = CachedExtraction(
        location,
        PhotoReader(),
        SiftExtractor(SiftOptions(max_features=max_features)),
        {"vlad": GlobalDescriptor(local=[Vlad()])},
    )
    index = PhotoIndex(location, describer)
    done = index.update(list_photos(folder), num_threads=2)
    return index, done


def names(index: PhotoIndex) -> list[str]:
    return [photo.name for photo in index.photos.values()]


def stored(folder: Path) -> set[str]:
    return {path.name for path in (folder.parent / "index" / "features").iterdir()}


def test_a_folder_is_described_once(folder):
    index, first = update(folder)
    assert first == Update(kept=0, described=4, removed=0, skipped=())
    assert names(index) == list(NAMES)
    assert list(index) == [1, 2, 3, 4]
    again, second = update(folder)
    assert second == Update(kept=4, described=0, removed=0, skipped=())
    assert names(again) == list(NAMES)


def test_progress_counts_what_is_described(folder):
    location = folder.parent / "index"
    describer = CachedExtraction(
        location,
        PhotoReader(),
        SiftExtractor(SiftOptions(max_features=200)),
        {"vlad": GlobalDescriptor(local=[Vlad()])},
    )
    told: list[tuple[int, int]] = []
    photos = list_photos(folder)
    for known in (photos[:1], photos):
        PhotoIndex(location, describer).update(
            known, num_threads=1, progress=lambda done, total: told.append((done, total))
        )
    assert told == [(1, 1), (1, 3), (2, 3), (3, 3)]


def test_views_and_vectors_are_those_of_the_photos(folder):
    index, _ = update(folder)
    photo = PhotoReader().read(folder / "2_0.png", "2_0.png")
    features = SiftExtractor(SiftOptions(max_features=200)).extract(photo)
    view = index[3]
    np.testing.assert_array_equal(view.features.descriptors, features.descriptors)
    assert (view.image_id, view.camera.width, view.camera.height) == (3, 320, 240)
    np.testing.assert_allclose(index.vector(3), Vlad().describe(features), atol=1e-6)


def test_photos_that_come_go_and_change(folder):
    update(folder)
    files_before = stored(folder)
    photo_files.save(folder, "0_0.png")
    (folder / "1_0.png").unlink()
    photo_files.photo(5, 0).save(folder / "1_60.png")
    index, done = update(folder)
    assert (done.kept, done.described, done.removed) == (2, 2, 1)
    assert names(index) == ["0_0.png", "1_60.png", "2_0.png", "sub/2_70.png"]
    changed = SiftExtractor(SiftOptions(max_features=200)).extract(
        PhotoReader().read(folder / "1_60.png", "x")
    )
    np.testing.assert_array_equal(index[2].features.descriptors, changed.descriptors)
    # What is of no use any more is gone from disk.
    assert len(stored(folder)) == 4
    assert len(stored(folder) & files_before) == 2


def test_a_file_written_anew_with_the_same_content_is_recalled(folder):
    update(folder)
    os.utime(folder / "1_0.png", ns=(1, 1))
    before = stored(folder)
    _, done = update(folder)
    assert done.described == 1
    assert stored(folder) == before


def test_bad_photos_are_skipped_each_time_and_taken_when_mended(folder):
    (folder / "bad.jpg").write_text("no image")
    _, first = update(folder)
    index, second = update(folder)
    expected = Skipped(
        "bad.jpg", SkipReason.NOT_AN_IMAGE, "the content is not JPEG, PNG, TIFF, BMP or WebP"
    )
    assert first.skipped == second.skipped == (expected,)
    assert (second.kept, second.described) == (4, 0)
    assert names(index) == list(NAMES)
    photo_files.photo(7, 0).save(folder / "bad.jpg")
    _, third = update(folder)
    assert (third.described, third.skipped) == (1, ())


def test_what_could_not_be_read_is_tried_again(folder, monkeypatch):
    refused = folder / "2_0.png"
    reading = Path.open

    def denied(path, *arguments, **options):
        if path == refused:
            raise PermissionError(13, "Permission denied")
        return reading(path, *arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", denied)
        _, first = update(folder)
    assert first.skipped == (Skipped("2_0.png", SkipReason.UNREADABLE, "Permission denied"),)
    _, second = update(folder)
    assert (second.kept, second.described, second.skipped) == (3, 1, ())


def test_copies_of_a_photo_are_all_there(folder):
    (folder / "copy.png").write_bytes((folder / "1_0.png").read_bytes())
    index, _ = update(folder)
    assert names(index)[3] == "copy.png"
    np.testing.assert_array_equal(index.vector(1), index.vector(4))


def test_with_other_settings_it_is_made_anew_and_says_so(folder):
    update(folder)
    _, done = update(folder, max_features=100)
    assert (done.kept, done.described) == (0, 4)
    assert str(done).startswith("index rebuilt: it was made with other settings")


DAMAGES = {
    "cut": lambda text: text[: len(text) // 2],
    "empty": lambda _: "",
    "list": lambda _: "[1, 2]",
    "number for a photo": lambda _: '{"format": 1, "settings": 0, "photos": 3}',
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_index_is_made_anew_and_says_so(folder, damage):
    update(folder)
    file = folder.parent / "index" / "index.json"
    file.write_text(DAMAGES[damage](file.read_text()))
    index, done = update(folder)
    assert done.discarded
    assert names(index) == list(NAMES)


@pytest.mark.parametrize(
    "entry", [{"path": "a"}, {"odd": 1}, 5, None, {"skipped": ["no such reason", ""]}]
)
def test_an_entry_that_makes_no_sense_counts_as_damage(folder, entry):
    update(folder)
    file = folder.parent / "index" / "index.json"
    content = json.loads(file.read_text())
    old = content["photos"]["1_0.png"]
    content["photos"]["1_0.png"] = {**old, **entry} if entry == {"skipped": entry} else entry
    file.write_text(json.dumps(content))
    index, done = update(folder)
    assert "damaged" in done.discarded
    assert len(index) == 4


def test_descriptions_lost_or_damaged_behind_its_back_are_made_again(folder):
    index, _ = update(folder)
    before = index[1].features.descriptors
    for kind in ("features", "vectors"):
        for path in (folder.parent / "index" / kind).iterdir():
            path.write_bytes(b"")
    # The files are there, so only reading them tells.
    damaged, done = update(folder)
    assert done.described == 0
    assert np.linalg.norm(damaged.vector(1)) == pytest.approx(1)
    np.testing.assert_array_equal(damaged[1].features.descriptors, before)
    for path in (folder.parent / "index" / "features").iterdir():
        path.unlink()
    _, done = update(folder)
    assert done.described == 4


def test_a_photo_that_vanishes_after_the_update_is_told_in_one_line(folder):
    index, _ = update(folder)
    for path in (folder.parent / "index" / "features").iterdir():
        path.unlink()
    (folder / "1_0.png").unlink()
    with pytest.raises(InputError, match=r"1_0\.png.*run again"):
        index[1]


def test_an_index_that_cannot_be_written_is_told_in_one_line(folder):
    (folder.parent / "index").write_text("a file")
    with pytest.raises(InputError, match="cannot be written"):
        update(folder)
