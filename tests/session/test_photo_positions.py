"""A session's positions: from EXIF or a file, and anew whenever it goes on."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import described

from sfm_front.errors import DependencyError, InputError
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.photos.position_checks import LeftOut
from sfm_front.photos.positions import PositionOptions
from sfm_front.session.options import SessionOptions
from sfm_front.session.photo_positions import PhotoPositions
from sfm_front.session.resume import nothing_to_do
from sfm_front.session.session import Session
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import Exif, ExtractedPhoto, GeoPosition, PhotoPath

NUM_PHOTOS = 5
WRITTEN = [GeoPosition(47.0 + i * 1e-4, 8.0, 500.0 + i) for i in range(NUM_PHOTOS)]
# What EXIF has, with the standard deviations that are taken for it, in metres.
BY_EXIF = {
    i + 1: (*place_of, 5.0, 10.0)
    for i, place_of in enumerate((p.latitude_deg, p.longitude_deg, p.altitude_m) for p in WRITTEN)
}


def options(**positions: object) -> SessionOptions:
    return SessionOptions(
        global_descriptor="vlad", threads=1, positions=PositionOptions(**positions)
    )


@pytest.fixture(scope="module")
def photos() -> list[ExtractedPhoto]:
    orbit = make_scene(12, 150, seed=1, layout="orbit")
    return [replace(described(orbit, i), exif=Exif(position=WRITTEN[i])) for i in range(NUM_PHOTOS)]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Of the second and the third photo, and of one that never comes."""
    file = tmp_path / "ppk.csv"
    file.write_text(
        "name,lat,lon,alt,h_acc,v_acc\n"
        "000001.jpg,47.5,8.5,400,0.5,2\n000002.jpg,47.6,8.5,401,,\n000099.jpg,47.7,8.5,402,,\n"
    )
    return file


BY_FILE = BY_EXIF | {2: (47.5, 8.5, 400.0, 0.5, 2.0), 3: (47.6, 8.5, 401.0, 5.0, 10.0)}


def priors_in(output: Path) -> dict[int, tuple[float, ...]]:
    """By image id: latitude, longitude, altitude, horizontal and vertical standard deviation."""
    with pycolmap.Database.open(output / "database.db") as database:
        priors = database.read_all_pose_priors()
    found = {}
    for prior in priors:
        east, north, up = np.sqrt(np.diag(prior.position_covariance)).tolist()
        assert east == north
        found[prior.corr_data_id.id] = (*prior.position.ravel().tolist(), east, up)
    return found


def add(output: Path, given: SessionOptions, photos: list[ExtractedPhoto], *, end: bool) -> None:
    with Session(output, given, resume=True) as session:
        for photo in photos:
            session.add_extracted(photo)
        if end:
            session.finish()


def test_priors_are_those_of_exif_with_default_accuracy(photos, tmp_path):
    add(tmp_path / "out", options(), photos, end=False)
    assert priors_in(tmp_path / "out") == BY_EXIF


def test_a_file_counts_before_exif(photos, tmp_path, file):
    add(tmp_path / "out", options(source=str(file)), photos, end=False)
    assert priors_in(tmp_path / "out") == BY_FILE


def test_off_means_none(photos, tmp_path):
    add(tmp_path / "out", options(source="off"), photos, end=False)
    assert priors_in(tmp_path / "out") == {}


def test_at_the_end_priors_that_cannot_be_are_gone(photos, tmp_path):
    """An altitude of 0 among others is known for what it is only then."""
    bad = Exif(position=replace(WRITTEN[1], altitude_m=0.0))
    given = [photos[0], replace(photos[1], exif=bad), *photos[2:]]
    add(tmp_path / "out", options(), given, end=False)
    assert priors_in(tmp_path / "out").keys() == {1, 2, 3, 4, 5}
    add(tmp_path / "out", options(), [], end=True)
    assert priors_in(tmp_path / "out").keys() == {1, 3, 4, 5}


@pytest.mark.parametrize("before", ["exif", "off", "file"])
@pytest.mark.parametrize("after", ["exif", "off", "file"])
def test_a_session_may_go_on_with_other_positions(photos, tmp_path, file, before, after):
    """As if it had been run with them from the start."""
    names = {"file": str(file)}
    expected = {"exif": BY_EXIF, "off": {}, "file": BY_FILE}
    output = tmp_path / "out"
    add(output, options(source=names.get(before, before)), photos[:3], end=False)
    add(output, options(source=names.get(after, after)), photos[3:], end=True)
    assert priors_in(output) == expected[after]


def test_a_session_may_go_on_with_another_accuracy(photos, tmp_path):
    add(tmp_path / "out", options(), photos, end=True)
    add(tmp_path / "out", options(horizontal_sigma_m=1.0, vertical_sigma_m=3.0), [], end=True)
    expected = {i: (*prior[:3], 1.0, 3.0) for i, prior in BY_EXIF.items()}
    assert priors_in(tmp_path / "out") == expected


def test_what_a_file_gives_is_not_stored_as_exif(photos, tmp_path, file):
    add(tmp_path / "out", options(source=str(file)), photos, end=True)
    with PhotoDatabase(tmp_path / "out" / "database.db") as database:
        assert [photo.exif.position for photo in database.photos()] == WRITTEN


def test_a_finished_session_has_something_to_do_with_other_positions(photos, tmp_path, file):
    output, folder = tmp_path / "out", tmp_path / "flight"
    folder.mkdir()
    paths = []
    for photo in photos[:2]:
        path = folder / photo.name
        path.write_bytes(photo.name.encode())
        paths.append(PhotoPath(photo.name, path))
    with_files = [
        replace(photo, path=path.path) for photo, path in zip(photos, paths, strict=False)
    ]
    add(output, options(), with_files, end=True)
    with PhotoDatabase(output / "database.db") as database:
        database.remember("sources", json.dumps({str(folder.resolve()): ""}))

    def is_done(given: SessionOptions) -> bool:
        return nothing_to_do(output, given, folder, paths, append=False)

    assert is_done(options())
    assert not is_done(options(source=str(file)))
    assert not is_done(options(horizontal_sigma_m=1.0))
    add(output, options(source=str(file)), [], end=True)
    assert is_done(options(source=str(file)))
    assert not is_done(options())
    file.write_text(file.read_text().replace("47.5", "47.4"))
    assert not is_done(options(source=str(file)))
    # An earlier version knew of no such options, and took EXIF.
    with PhotoDatabase(output / "database.db") as database:
        stored = json.loads(database.recall("options") or "")
        del stored["positions"], stored["files"]
        database.remember("options", json.dumps(stored))
    assert is_done(options())
    assert not is_done(options(source="off"))


def test_a_file_that_cannot_be_used_leaves_everything_as_it_was(photos, tmp_path, monkeypatch):
    output = tmp_path / "out"
    add(output, options(), photos[:1], end=True)
    before = {path: path.read_bytes() for path in output.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match="no such file"):
        Session(output, options(source=str(tmp_path / "none.csv")), overwrite=True)
    (tmp_path / "geo.txt").write_text("EPSG:32632\n000001.jpg 500000 5200000\n")
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(DependencyError, match="pyproj"):
        Session(output, options(source=str(tmp_path / "geo.txt")), overwrite=True)
    assert {path: path.read_bytes() for path in output.rglob("*") if path.is_file()} == before


def test_what_is_left_out_is_named_with_its_reason(file):
    positions = PhotoPositions(PositionOptions(source=str(file)))
    for image_id, exif in enumerate((*WRITTEN[:3], GeoPosition(0.0, 0.0, 1.0)), start=1):
        positions.take(image_id, f"{image_id:06d}.jpg", Exif(position=exif))
    assert positions.take(9, "nowhere.jpg", Exif()) is None
    checked = positions.checked()
    assert checked.left_out == {4: LeftOut.NO_FIX}
    assert checked.usable[1] == GeoPosition(47.5, 8.5, 400.0, 0.5, 2.0)
    assert checked.usable[3] == replace(WRITTEN[2], horizontal_sigma_m=5.0, vertical_sigma_m=10.0)
    assert positions.num_unused_rows == 1
