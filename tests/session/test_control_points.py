"""A session holds its model to control points, and loses nothing to a mistake in them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.control_files import Row, control_rows, write_gcp_list
from helpers.photo_stream import described, position_errors_m

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import ControlPointsRefused, Event, HeldToControlPoints
from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.control.options import ControlOptions
from sfm_front.georeference.control.residuals import PointRole
from sfm_front.georeference.sidecar import FILE_NAME, read_sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.photos.positions import PositionOptions
from sfm_front.reports.report_json import read_report
from sfm_front.reports.summary import closing_summary
from sfm_front.session.options import SessionOptions
from sfm_front.session.resume import nothing_to_do
from sfm_front.session.session import Session
from sfm_front.session.summing_up import SessionResult
from sfm_front.storage.colmap_models import read_model
from sfm_front.types import Exif, ExtractedPhoto, GeoPosition

NUM_PHOTOS = 12
# Where the scene, 100 m below its photos, is (0, 0, 0).
SCENE = LocalFrame(48.0, 9.0, 300.0)
# A pixel is 8 cm on the ground; marks of 0.1 px and keypoints of 0.5 px, in three photos and more.
CHECK_CE90_M, CHECK_LE90_M = 0.05, 0.15
CAMERA_M = 0.3
RAISED_M = 0.5


@pytest.fixture(scope="module")
def strip() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 400, seed=3, layout="strip")


@pytest.fixture(scope="module")
def photos(strip) -> list[ExtractedPhoto]:
    return [described(strip, index) for index in range(NUM_PHOTOS)]


@pytest.fixture(scope="module")
def rows(strip) -> list[Row]:
    return control_rows(strip, SCENE)


def options(file: Path | None, *, gps: str = "exif", **control: object) -> SessionOptions:
    return SessionOptions(
        global_descriptor="vlad",
        threads=1,
        positions=PositionOptions(source=gps),
        control_points=ControlOptions(file=file, **control),
    )


def run(
    output: Path,
    photos: list[ExtractedPhoto],
    chosen: SessionOptions,
    events: list[Event] | None = None,
    *,
    resume: bool = False,
) -> SessionResult:
    on_event = None if events is None else events.append
    with Session(output, chosen, resume=resume, on_event=on_event) as session:
        for photo in photos:
            session.add_extracted(photo)
        return session.finish()


def camera_errors_m(result: SessionResult, strip: SyntheticScene, origin: LocalFrame):
    """(N, 3) of the largest model, in ENU at the origin, less the truth."""
    truth = strip.truth()
    model = result.models[0].reconstruction
    true = {image.name: image.projection_center() for image in truth.images.values()}
    images = [model.image(i) for i in model.reg_image_ids()]
    there = origin.to_enu(SCENE.to_wgs84(np.array([true[image.name] for image in images])))
    return np.array([image.projection_center() for image in images]) - there


@pytest.fixture(scope="module")
def held(tmp_path_factory, photos, rows) -> tuple[Path, SessionResult, list[Event]]:
    """Output, result and events of a session whose photos have no positions."""
    folder = tmp_path_factory.mktemp("held")
    file = write_gcp_list(folder / "gcp_list.txt", rows)
    events: list[Event] = []
    return folder / "out", run(folder / "out", photos, options(file), events), events


def test_without_positions_points_put_the_model_in_enu(held, strip):
    output, result, _ = held
    sidecar = read_sidecar(output / "sparse" / FILE_NAME)
    assert sidecar.state is GeoreferenceState.METRIC
    assert sidecar.reasons == ("held to 6 control points",)
    assert sidecar.models_in_enu == (0,)
    assert sidecar.origin is not None
    assert np.abs(camera_errors_m(result, strip, sidecar.origin)).max() < CAMERA_M
    # What is on the disk is that.
    written = read_model(output / "sparse" / "0")
    for image_id, image in result.models[0].reconstruction.images.items():
        there = written.image(image_id).projection_center()
        np.testing.assert_allclose(there, image.projection_center(), atol=1e-9)


def test_each_point_is_told_in_metres_and_pixels(held, rows):
    output, result, _ = held
    control = result.summary.control_points
    assert control is not None
    assert (control.file, control.model, control.not_used) == ("gcp_list.txt", 0, "")
    assert control.missing_photos == ()
    assert [p.name for p in control.with_role(PointRole.CONTROL)] == [f"gcp{n}" for n in range(6)]
    assert len(control.with_role(PointRole.CHECKPOINT)) == 3
    assert sum(len(point.marks) for point in control.points) == len(rows)
    assert control.checkpoints.ce90_m < CHECK_CE90_M
    assert control.checkpoints.le90_m < CHECK_LE90_M
    assert control.wrong_marks == []
    assert read_report(output).control_points == control
    assert read_sidecar(output / "sparse" / FILE_NAME).control_points == control
    words = closing_summary(result.summary, output)
    assert "control points of gcp_list.txt: 6 of 6 hold sparse/0: RMS east 0.0" in words
    assert "  3 checkpoints: RMS east 0.0" in words


def test_listeners_hear_of_it(held):
    _, result, events = held
    (event,) = [event for event in events if isinstance(event, HeldToControlPoints)]
    checkpoints = result.summary.control_points.checkpoints
    assert (event.num_control, event.num_checkpoints) == (6, 3)
    assert (event.ce90_m, event.le90_m) == (checkpoints.ce90_m, checkpoints.le90_m)
    assert "is held to 6 control points and 3 checkpoints, CE90 0.0" in str(event)


def test_points_that_do_not_fit_are_left_out_of_the_model(held):
    _, result, _ = held
    model = result.models[0].reconstruction
    assert max(point.error for point in model.points3D.values()) < 4.0


def test_a_checkpoint_does_not_hold_the_model(tmp_path, photos, rows):
    """And a point and a mark that are wrong are named."""
    changed = [
        replace(row, place=(*row.place[:2], row.place[2] + RAISED_M * (row.point == "1_check")))
        for row in rows
    ]
    wrong = next(n for n, row in enumerate(changed) if row.point == "gcp2")
    x, y = changed[wrong].xy
    changed[wrong] = replace(changed[wrong], xy=(x + 40, y))
    result = run(tmp_path / "out", photos, options(write_gcp_list(tmp_path / "gcp.txt", changed)))
    control = result.summary.control_points
    off = {point.name: point.up_m for point in control.with_role(PointRole.CHECKPOINT)}
    assert off["1_check"] == pytest.approx(-RAISED_M, abs=CHECK_LE90_M)
    assert abs(off["0_check"]) < CHECK_LE90_M
    assert [(p.name, m.photo) for p, m in control.wrong_marks] == [("gcp2", changed[wrong].photo)]
    words = closing_summary(result.summary, tmp_path / "out")
    assert f"  gcp2: its mark in {changed[wrong].photo} is off by " in words


def gps(photos, strip, shift_m, sigma_m, seed=0):
    """Photos with positions that are all off by the same, and each by some more."""
    centres = np.array([pose.inverse().translation for pose in strip.cams_from_world])
    there = centres + shift_m + np.random.default_rng(seed).normal(0, sigma_m, centres.shape)
    return [
        replace(photo, exif=Exif(position=GeoPosition(*place)))
        for photo, place in zip(photos, SCENE.to_wgs84(there).tolist(), strict=True)
    ]


def test_points_win_over_positions_whose_frame_stays(tmp_path, photos, rows, strip):
    shift = np.array([2.0, -1.5, 3.0])
    with_gps = gps(photos, strip, shift, 0.3)
    file = write_gcp_list(tmp_path / "gcp.txt", rows)
    free = run(tmp_path / "free", with_gps, options(None))
    origin = read_sidecar(tmp_path / "free" / "sparse" / FILE_NAME).origin
    off = camera_errors_m(free, strip, origin).mean(axis=0)
    np.testing.assert_allclose(off, shift, atol=1.0)
    result = run(tmp_path / "out", with_gps, options(file))
    sidecar = read_sidecar(tmp_path / "out" / "sparse" / FILE_NAME)
    assert sidecar.origin == origin
    assert sidecar.models_in_enu == (0,)
    assert np.abs(camera_errors_m(result, strip, origin)).max() < CAMERA_M
    assert sidecar.reasons == (f"held to 6 control points and {NUM_PHOTOS} positions of photos",)
    # Positions are told as they are: off, in the mean.
    residuals = sidecar.residuals
    means = [residuals.east.mean, residuals.north.mean, residuals.up.mean]
    np.testing.assert_allclose(means, shift, atol=0.5)
    assert sidecar.uncertainty is None
    # Once more, without control points: the positions have it again.
    resumed = run(tmp_path / "out", [], options(None), resume=True)
    sidecar = read_sidecar(tmp_path / "out" / "sparse" / FILE_NAME)
    assert (sidecar.origin, sidecar.control_points) == (origin, None)
    off = camera_errors_m(resumed, strip, origin).mean(axis=0)
    np.testing.assert_allclose(off, shift, atol=1.0)


def test_points_without_heights_level_the_model(tmp_path, photos, rows):
    file = write_gcp_list(tmp_path / "gcp.txt", rows, with_heights=False)
    result = run(tmp_path / "out", photos, options(file))
    control = result.summary.control_points
    assert control.checkpoints.ce90_m < 4 * CHECK_CE90_M
    assert control.checkpoints.le90_m is None
    images = result.models[0].reconstruction.images.values()
    assert np.mean([image.viewing_direction()[2] for image in images]) < -0.99


def test_points_far_from_the_positions_are_refused(tmp_path, photos, rows, strip):
    elsewhere = [replace(row, place=(row.place[0] + 6, *row.place[1:])) for row in rows]
    file = write_gcp_list(tmp_path / "gcp.txt", elsewhere)
    result = run(tmp_path / "out", gps(photos, strip, np.zeros(3), 0.3), options(file))
    assert "km from where the photos were taken" in result.summary.control_points.not_used
    sidecar = read_sidecar(tmp_path / "out" / "sparse" / FILE_NAME)
    assert np.abs(camera_errors_m(result, strip, sidecar.origin)).max() < 3


def test_a_mark_outside_its_photo_is_told_at_once_and_spoils_nothing(tmp_path, photos, rows, strip):
    wrong = replace(rows[0], xy=(1700.0, 100.0))
    later = replace(rows[-1], xy=(1800.0, 100.0))
    file = write_gcp_list(tmp_path / "gcp_list.txt", [wrong, *rows[1:-1], later])
    events: list[Event] = []
    out = tmp_path / "out"
    result = run(out, photos, options(file), events)
    told = [n for n, event in enumerate(events) if isinstance(event, ControlPointsRefused)]
    assert len(told) == 1
    assert "(1700, 100) is outside 0000" in str(events[told[0]])
    assert "--gcp-size" in str(events[told[0]])
    assert told[0] < len(events) / 2
    control = result.summary.control_points
    assert control.model is None
    assert control.not_used == events[told[0]].reason
    words = closing_summary(result.summary, out)
    (line,) = [line for line in words.splitlines() if line.startswith("control points")]
    assert line == (
        "control points of gcp_list.txt are not used, the models are as without them: "
        + control.not_used
    )
    assert position_errors_m(result.models[0].reconstruction, strip).max() < CAMERA_M
    sidecar = read_sidecar(out / "sparse" / FILE_NAME)
    assert sidecar.state is GeoreferenceState.NONE
    assert sidecar.models_in_enu == ()
    assert read_report(out).control_points == control
    # The same file, mended: the same command goes on.
    assert nothing_to_do(out, options(file), tmp_path, [], append=False)
    write_gcp_list(file, rows)
    assert not nothing_to_do(out, options(file), tmp_path, [], append=False)
    mended = run(out, [], options(file), resume=True).summary.control_points
    assert mended.model == 0
    assert mended.checkpoints.ce90_m < CHECK_CE90_M
    assert nothing_to_do(out, options(file), tmp_path, [], append=False)


def test_marks_of_larger_photos_need_their_size(tmp_path, photos, rows):
    larger = [replace(r, xy=tuple(2 * (v + 0.5) - 0.5 for v in r.xy)) for r in rows]
    file = write_gcp_list(tmp_path / "gcp.txt", larger)
    result = run(tmp_path / "out", photos, options(file, marked_size=(3200, 2400)))
    assert result.summary.control_points.checkpoints.ce90_m < CHECK_CE90_M
    wrong = options(file, marked_size=(3200, 3200))
    result = run(tmp_path / "out", [], wrong, resume=True)
    assert "Correct --gcp-size" in result.summary.control_points.not_used


def test_too_few_points_in_the_model_leave_it_as_it_is(tmp_path, photos, rows):
    few = {"gcp0", "gcp1"}
    elsewhere = [r if r.point in few else replace(r, photo=f"other/{r.photo}.png") for r in rows]
    file = write_gcp_list(tmp_path / "gcp.txt", elsewhere)
    result = run(tmp_path / "out", photos, options(file))
    control = result.summary.control_points
    assert control.not_used.startswith("2 control points have marks that agree")
    assert control.missing_photos[0].startswith("other/0000")
    assert control.points == ()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "gcp.txt: cannot be read: No such file"),
        ("", "gcp.txt: empty"),
        ("EPSG:4326\n9 48 300 10 x a.jpg\n", "gcp.txt, line 2: py is 'x', not a number"),
        ("EPSG:4326\n9 48 300 10 20 a.jpg\n", "at least 3 are needed, beside checkpoints"),
        ("GRID OF MINE\n9 48 300 10 20 a.jpg\n", "gcp.txt, line 1: 'GRID OF MINE' is no reference"),
    ],
)
def test_a_file_that_cannot_be_used_is_told_before_anything_is_written(tmp_path, content, message):
    if content is not None and "GRID" in content:
        pytest.importorskip("pyproj")
    file = tmp_path / "gcp.txt"
    if content is not None:
        file.write_text(content)
    with pytest.raises(InputError) as caught:
        Session(tmp_path / "out", options(file))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_control_points_and_georegister_off_exclude_each_other(tmp_path):
    with pytest.raises(ConfigError, match="georegister"):
        SessionOptions(georegister="off", control_points=ControlOptions(file=tmp_path / "gcp.txt"))
