"""Sessions over photos with positions: in ENU as soon as these fix it, and true to the end."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from helpers.positioned_stream import (
    FRAME,
    centres_in_enu,
    measured,
    options,
    positions_at,
    taken,
    true_centres,
)

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import Event, Georeferenced, PhotoPlaced
from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.sidecar import FILE_NAME, Sidecar, read_sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.photos.position_checks import LeftOut
from sfm_front.photos.positions import PositionOptions
from sfm_front.reports.explanation import explain
from sfm_front.reports.run_summary import RunSummary
from sfm_front.reports.summary import closing_summary
from sfm_front.session import snapshots
from sfm_front.session.session import Session
from sfm_front.types import ExtractedPhoto, Float64Array, GeoPosition

NUM_PHOTOS = 24
# GPS is off by 0.5, 0.5 and 1 m, and two dozen photos average it. Heights are worse: the model of a
# flat strip bends, and with it a tilt of 0.5 degrees lifts its corners, 80 m away, by 0.7 m.
TOLERANCE_M = (1.0, 1.0, 3.0)
# Of points on the ground, at bushes and hills: metres below and above, and photos see 60 m aside.
GROUND_M, ASIDE_M = 25.0, 100.0
SECOND_FLIGHT_FROM = 12
ALWAYS = 1e-6


@pytest.fixture(scope="module")
def flight() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 250, seed=3, layout="strip")


@pytest.fixture(scope="module")
def photos(flight) -> list[ExtractedPhoto]:
    return taken(flight, positions_at(measured(flight)))


@dataclass
class Run:
    """What a session left, and what was said meanwhile."""

    output: Path
    events: list[Event]
    states: list[GeoreferenceState]
    summary: RunSummary

    @property
    def sidecar(self) -> Sidecar:
        return read_sidecar(self.output / "sparse" / FILE_NAME)

    @property
    def frame(self) -> LocalFrame:
        origin = self.sidecar.origin
        assert origin is not None
        return origin

    def errors_m(self, scene: SyntheticScene, prefix: str = "", model: int = 0) -> Float64Array:
        """(M, 3) of the cameras as they are exported, with no fit to the truth."""
        folder = self.output / "sparse" / str(model)
        found, truth = centres_in_enu(folder, self.frame, scene, prefix=prefix)
        assert len(found) == len(scene)
        return found - truth


def run(output: Path, photos: Sequence[ExtractedPhoto], **changes: object) -> Run:
    heard: list[Event] = []
    states = []
    resume = (output / "database.db").exists()
    with Session(output, options(**changes), resume=resume, on_event=heard.append) as session:
        for photo in photos:
            session.add_extracted(photo)
            states.append(session.georeference.state)
        summary = session.finish().summary
    return Run(output, heard, states, summary)


@pytest.fixture(scope="module")
def good(photos, tmp_path_factory) -> Run:
    return run(tmp_path_factory.mktemp("good") / "out", photos)


def told(result: Run) -> str:
    return closing_summary(result.summary, result.output)


def test_the_frame_is_there_before_a_third_of_the_photos_and_stays(flight, good):
    metric = good.states.index(GeoreferenceState.METRIC)
    assert metric + 1 <= NUM_PHOTOS / 3
    assert set(good.states[metric:]) == {GeoreferenceState.METRIC}
    origins = {e.origin for e in good.events if isinstance(e, Georeferenced) and e.origin}
    assert origins == {(good.frame.latitude_deg, good.frame.longitude_deg, good.frame.altitude_m)}
    assert (np.abs(good.errors_m(flight)) < TOLERANCE_M).all()


def test_photos_are_placed_where_they_are_on_the_earth(flight, good):
    """Each in the frame of its model at that moment: metric, once it is said to be."""
    is_metric, placed = False, []
    for event in good.events:
        if isinstance(event, Georeferenced):
            is_metric = event.state == "metric"
        elif isinstance(event, PhotoPlaced) and is_metric:
            pose = pycolmap.Rigid3d(
                pycolmap.Rotation3d(np.array(event.quaternion_xyzw)), np.array(event.translation)
            )
            placed.append((event.image_id - 1, pose.inverse().translation))
    assert len(placed) > NUM_PHOTOS / 2
    found = FRAME.to_enu(good.frame.to_wgs84(np.array([centre for _, centre in placed])))
    truth = true_centres(flight)[[index for index, _ in placed]]
    # The first ones, by a few positions, are less exact.
    assert np.median(np.abs(found - truth), axis=0).max() < 3.0


def test_points_are_on_the_ground(flight, good):
    cloud = pycolmap.Reconstruction()
    cloud.import_PLY(good.output / "sparse" / "0" / "points3D.ply")
    points = np.array([point.xyz for point in cloud.points3D.values()])
    enu = FRAME.to_enu(good.frame.to_wgs84(points))
    truth = true_centres(flight)
    assert (np.abs(enu[:, 2]) < GROUND_M).all()
    assert (enu[:, :2] > truth[:, :2].min(axis=0) - ASIDE_M).all()
    assert (enu[:, :2] < truth[:, :2].max(axis=0) + ASIDE_M).all()


def test_it_is_told_as_surveyors_state_it(good):
    sidecar = good.sidecar
    assert good.summary.georeference.sidecar.residuals == sidecar.residuals
    assert good.summary.georeference.kept_positions is True
    assert sidecar.models_in_enu == (0,)
    assert sidecar.residuals.num_used == NUM_PHOTOS
    # Standard deviations of the noise, by twenty of them.
    for axis, noise in (("east", 0.5), ("north", 0.5), ("up", 1.0)):
        assert getattr(sidecar.residuals, axis).rms == pytest.approx(noise, rel=0.5)
    assert sidecar.uncertainty.scale < 0.02
    # 1300 pixels at 100 m.
    assert sidecar.flight.gsd_cm_per_px == pytest.approx(100 * 100 / 1300, rel=0.1)
    assert sidecar.flight.height_m == pytest.approx(100, abs=10)
    assert "in metres (east, north, up): scale ±" in told(good)
    assert f"{NUM_PHOTOS} of {NUM_PHOTOS} positions" in told(good)


def test_without_georegistering_models_are_those_without_positions(photos, tmp_path):
    few = photos[:9]
    run(tmp_path / "off", few, georegister="off")
    run(tmp_path / "none", few, positions=PositionOptions(source="off"))
    files = [path.name for path in (tmp_path / "none" / "sparse" / "0").glob("*.bin")]
    assert len(files) > 2
    for name in files:
        models = [tmp_path / output / "sparse" / "0" / name for output in ("off", "none")]
        assert models[0].read_bytes() == models[1].read_bytes(), name
    for output in ("off", "none"):
        assert not (tmp_path / output / "sparse" / FILE_NAME).exists()


@pytest.mark.parametrize("how", ["closed", "killed"])
def test_the_frame_survives_an_end_of_any_kind(flight, photos, tmp_path, monkeypatch, how):
    monkeypatch.setattr(snapshots, "_MAX_SHARE", float("inf"))
    output = tmp_path / "out"
    with Session(output, options(snapshot_seconds=ALWAYS)) as session:
        for photo in photos[:10]:
            session.add_extracted(photo)
        assert session.georeference.state is GeoreferenceState.METRIC
        frame = session.georeference.frame
        if how == "killed":
            shutil.copytree(output, tmp_path / "killed")
            output = tmp_path / "killed"
    first = {
        image.name: image.projection_center()
        for image in pycolmap.Reconstruction(output / "sparse" / "0").images.values()
    }
    assert read_sidecar(output / "sparse" / FILE_NAME).origin == frame
    result = run(output, photos[10:])
    assert set(result.states) == {GeoreferenceState.METRIC}
    assert result.frame == frame
    last = pycolmap.Reconstruction(output / "sparse" / "0")
    moves = [
        image.projection_center() - first[image.name]
        for image in last.images.values()
        if image.name in first
    ]
    # By what ten positions left open.
    assert np.median(np.abs(moves), axis=0).max() < 2.0
    assert (np.abs(result.errors_m(flight)) < TOLERANCE_M).all()


def test_a_finished_session_goes_on_in_its_frame(flight, photos, tmp_path):
    first = run(tmp_path / "out", photos[:14])
    frame = first.frame
    result = run(tmp_path / "out", photos[14:])
    assert result.frame == frame
    assert set(result.states) == {GeoreferenceState.METRIC}
    assert (np.abs(result.errors_m(flight)) < TOLERANCE_M).all()


def test_two_models_are_in_one_frame(tmp_path):
    """Two sites, a kilometre apart."""
    sites = {
        "a/": (make_scene(10, 250, seed=3, layout="strip"), (0.0, 0.0, 0.0)),
        "b/": (make_scene(9, 250, seed=5, layout="strip"), (1000.0, 200.0, 30.0)),
    }
    photos = [
        photo
        for prefix, (scene, shift) in sites.items()
        for photo in taken(scene, positions_at(measured(scene) + shift), prefix=prefix)
    ]
    result = run(tmp_path / "out", photos)
    assert result.sidecar.models_in_enu == (0, 1)
    for model, (prefix, (scene, shift)) in enumerate(sites.items()):
        errors = result.errors_m(scene, prefix, model) - shift
        assert (np.abs(errors) < np.multiply(2, TOLERANCE_M)).all(), prefix


@pytest.fixture(scope="module")
def without(flight, tmp_path_factory) -> Path:
    """The output of a session that has taken in all photos, in two flights, and knows no position.

    Going on with it with other positions, only its end is new.
    """
    output = tmp_path_factory.mktemp("without") / "out"
    with Session(output, options(snapshot_seconds=ALWAYS)) as session:
        for index, photo in enumerate(taken(flight, [None] * NUM_PHOTOS)):
            later = index >= SECOND_FLIGHT_FROM
            when = photo.exif.captured_at
            exif = replace(photo.exif, captured_at=when.replace(hour=13) if later else when)
            session.add_extracted(replace(photo, exif=exif))
    return output


class TestBadPositions:
    """Each is named with its reason, and spoils nothing."""

    @pytest.fixture
    def enu(self, flight) -> Float64Array:
        return measured(flight)

    def go_on(
        self, without: Path, folder: Path, positions: Sequence[GeoPosition | None], **sigmas: float
    ) -> Run:
        rows = [
            f"{index:06d}.jpg,{p.latitude_deg!r},{p.longitude_deg!r},"
            f"{'' if p.altitude_m is None else repr(p.altitude_m)}"
            for index, p in enumerate(positions)
            if p is not None
        ]
        file = folder / "positions.csv"
        file.write_text("\n".join(["name,lat,lon,alt", *rows]) + "\n", encoding="utf-8")
        shutil.copytree(without, folder / "out")
        given = PositionOptions(source=str(file), **sigmas)
        return run(folder / "out", [], positions=given)

    def test_one_that_is_200_m_off_is_named(self, flight, without, enu, tmp_path):
        enu[7] += (160, -120, 0)
        result = self.go_on(without, tmp_path, positions_at(enu))
        assert list(result.sidecar.names.values()) == ["000007.jpg"]
        (outlier,) = result.sidecar.residuals.outliers
        assert outlier.metres == pytest.approx(200, abs=4)
        assert (np.abs(result.errors_m(flight)) < TOLERANCE_M).all()
        assert "positions left out: 000007.jpg 20" in told(result)
        said = str(explain(result.output, "000007.jpg"))
        assert re.search(r"its position is (19[89]|20[0-2])\.\d\d m away in the plane", said)
        assert "taken for wrong" in said
        assert "taken for wrong" not in str(explain(result.output, "000008.jpg"))

    def test_a_flight_that_is_15_m_too_high_is_named(self, flight, without, enu, tmp_path):
        enu[SECOND_FLIGHT_FROM:, 2] += 15
        result = self.go_on(without, tmp_path, positions_at(enu))
        (offset,) = result.sidecar.height_offsets_m.values()
        assert abs(offset) == pytest.approx(15, abs=2)
        errors = result.errors_m(flight)
        # Nobody says which flight is right.
        errors[:, 2] -= np.median(errors[:, 2])
        assert (np.abs(errors) < TOLERANCE_M).all()
        assert "heights differ from those of the other flights: of flight" in told(result)

    @pytest.mark.parametrize("bad", [[0], [3, 9, 15]])
    @pytest.mark.parametrize("altitude", [None, 0.0])
    def test_lost_altitudes_are_named(self, flight, without, enu, tmp_path, bad, altitude):
        positions = positions_at(enu)
        for index in bad:
            positions[index] = replace(positions[index], altitude_m=altitude)
        result = self.go_on(without, tmp_path, positions)
        assert result.sidecar.left_out == {
            flight.name(index): LeftOut.NO_ALTITUDE.value for index in bad
        }
        assert (np.abs(result.errors_m(flight)) < TOLERANCE_M).all()
        assert LeftOut.NO_ALTITUDE.value in told(result)
        said = str(explain(result.output, flight.name(bad[0])))
        assert f"its position is left out: {LeftOut.NO_ALTITUDE.value}" in said

    def test_photos_without_gps_among_others(self, flight, without, enu, tmp_path):
        positions = [p if i % 3 else None for i, p in enumerate(positions_at(enu))]
        result = self.go_on(without, tmp_path, positions)
        assert result.sidecar.residuals.num_used == NUM_PHOTOS - NUM_PHOTOS // 3
        assert (np.abs(result.errors_m(flight)) < np.multiply(1.5, TOLERANCE_M)).all()

    def test_five_positions_only(self, flight, without, enu, tmp_path):
        """At the corners, and in the middle."""
        some = {0, 5, 12, 18, 23}
        positions = [p if i in some else None for i, p in enumerate(positions_at(enu))]
        result = self.go_on(without, tmp_path, positions)
        assert result.sidecar.state is GeoreferenceState.METRIC
        assert (np.abs(result.errors_m(flight)) < np.multiply(3, TOLERANCE_M)).all()

    def test_two_positions_are_too_few(self, without, enu, tmp_path):
        positions = [p if i < 2 else None for i, p in enumerate(positions_at(enu))]
        result = self.go_on(without, tmp_path, positions)
        assert result.sidecar.state is GeoreferenceState.NONE
        assert result.sidecar.models_in_enu == ()
        assert "not in metres: 2 positions, 3 are needed; " in told(result)

    def test_positions_that_contradict_the_photos_are_not_believed(
        self, flight, without, enu, tmp_path
    ):
        """A map that is stretched by a fifth to the north, and claims centimetres."""
        enu[:, 1] *= 1.2
        sigmas = {"horizontal_sigma_m": 0.02, "vertical_sigma_m": 0.05}
        result = self.go_on(without, tmp_path, positions_at(enu), **sigmas)
        assert "beware: model and positions differ by" in told(result)
        residuals = result.sidecar.residuals
        assert residuals.ce90_m > 5
        # The model has the shape that photos give it.
        errors = result.errors_m(flight)
        found = errors + true_centres(flight)
        east_m, north_m, _ = np.ptp(found, axis=0) / np.ptp(true_centres(flight), axis=0)
        assert north_m / east_m == pytest.approx(1, abs=0.02)

    def test_rows_that_name_no_photo_are_counted(self, without, enu, tmp_path):
        positions = [*positions_at(enu), *positions_at(enu[:2])]
        result = self.go_on(without, tmp_path, positions)
        assert result.summary.georeference.num_unused_rows == 2
        assert "2 rows of the file of positions name no photo" in told(result)

    def test_without_any_position_nothing_is_said(self, without, tmp_path):
        shutil.copytree(without, tmp_path / "out")
        result = run(tmp_path / "out", [])
        assert result.summary.georeference is None
        assert not (tmp_path / "out" / "sparse" / FILE_NAME).exists()
        assert "metres" not in told(result)
        report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
        assert report["georeference"] is None


def test_photos_on_a_line_fix_less_and_that_is_said(flight, tmp_path):
    on_line = 6  # of the first strip
    photos = taken(flight, positions_at(measured(flight))[:on_line])
    result = run(tmp_path / "out", photos)
    assert "the photos lie on a line: the rotation about it is" in told(result)
    found, truth = centres_in_enu(result.output / "sparse" / "0", result.frame, flight)
    # Along and across the line; cameras held level tell the way up.
    assert (np.abs(found - truth) < (2.0, 2.0, 3.0)).all()


def test_bad_positions_do_not_lead_a_stream_astray(flight, tmp_path):
    """The first photos are the worst: the altitude is lost, then one is far off, one has no GPS."""
    enu = measured(flight)
    enu[2] += (-120, 160, 0)
    enu[11] += (160, 120, 20)
    positions: list[GeoPosition | None] = list(positions_at(enu))
    positions[0] = replace(positions[0], altitude_m=0.0)
    positions[14] = replace(positions[14], altitude_m=0.0)
    positions[4] = positions[20] = None
    result = run(tmp_path / "out", taken(flight, positions))
    assert set(result.sidecar.names.values()) == {"000002.jpg", "000011.jpg"}
    assert result.sidecar.left_out.keys() == {"000000.jpg", "000014.jpg"}
    metric = result.states.index(GeoreferenceState.METRIC)
    assert set(result.states[metric:]) == {GeoreferenceState.METRIC}
    assert (np.abs(result.errors_m(flight)) < TOLERANCE_M).all()


def test_ten_that_are_200_m_off_do_not_lead_a_stream_astray(flight, tmp_path):
    enu, rng = measured(flight), np.random.default_rng(1)
    bad = sorted(rng.choice(NUM_PHOTOS, 10, replace=False).tolist())
    angles = rng.uniform(0, 2 * np.pi, 10)
    enu[bad] += 200 * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    result = run(tmp_path / "out", taken(flight, positions_at(enu)))
    assert set(result.sidecar.names.values()) == {flight.name(index) for index in bad}
    assert (np.abs(result.errors_m(flight)) < np.multiply(1.5, TOLERANCE_M)).all()
