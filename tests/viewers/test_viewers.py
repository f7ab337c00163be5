"""What is drawn of a model, from where, and what is said when it cannot be drawn."""

from __future__ import annotations

import argparse
import subprocess
import sys

import numpy as np
import pytest
from helpers.model_building import FOCAL, HEIGHT, WIDTH, looking, make_model
from PIL import Image

from sfm_front import viewers
from sfm_front.cli import view as cli
from sfm_front.cli.main import main
from sfm_front.errors import ConfigError, DependencyError, InputError
from sfm_front.georeference.sidecar import FILE_NAME, Sidecar, write_sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.runtime.subprocess_env import module_environment
from sfm_front.viewers import offscreen, open3d_loader
from sfm_front.viewers.model_drawing import build_scene, sequence_colors
from sfm_front.viewers.options import BACKGROUNDS, DrawOptions
from sfm_front.viewers.viewpoint import VERTICAL_FIELD_OF_VIEW_DEG

UP = np.array([0.0, 0.0, 1.0])
DIRECTION = 1e-9  # of unit vectors computed in float64


def walk_past_a_wall():
    """Five photos taken along x, facing a wall at y = 5, z up."""
    cameras = {f"{i}.jpg": looking([i, 0, 0], [0, 1, 0], UP) for i in range(5)}
    grid = np.stack(np.meshgrid(np.linspace(0, 4, 21), [5.0], np.linspace(-1, 1, 11)), axis=-1)
    return make_model(cameras, grid.reshape(-1, 3))


def fly_to_and_fro():
    """Two strips flown in opposite directions over the ground z = 0, looking straight down."""
    cameras = {}
    for strip, heading in enumerate([[0, 1, 0], [0, -1, 0]]):
        for i in range(4):
            cameras[f"{strip}{i}.jpg"] = looking([3 * strip, i, 8], [0, 0, -1], heading)
    ground = np.random.default_rng(0).uniform([-2, -2, 0], [5, 5, 0.3], (400, 3))
    return make_model(cameras, ground)


def circle_an_object():
    angles = np.radians(np.arange(0, 360, 30))
    spots = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1) * 4
    cameras = {f"{i:02}.jpg": looking(spot, -spot, UP) for i, spot in enumerate(spots)}
    return make_model(cameras, np.random.default_rng(0).uniform(-1, 1, (300, 3)))


SCENES = [walk_past_a_wall, fly_to_and_fro, circle_an_object]


def on_screen(points, view, aspect):
    """(N, 2) in [-1, 1] inside the picture, and whether they lie before the viewer."""
    forward = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    right = np.cross(forward, view.up)
    x, y, depth = ((points - view.eye) @ np.stack([right, view.up, forward]).T).T
    half = np.tan(np.radians(VERTICAL_FIELD_OF_VIEW_DEG) / 2)
    return np.stack([x / (depth * half * aspect), y / (depth * half)], axis=1), depth > 0


@pytest.mark.parametrize("make", SCENES)
@pytest.mark.parametrize(("width", "height"), [(1600, 1000), (500, 900)])
def test_the_view_holds_every_camera_and_nearly_every_point(make, width, height):
    scene = build_scene(make(), DrawOptions(width=width, height=height))
    corners, before = on_screen(scene.vertices, scene.view, width / height)
    assert before.all()
    assert np.abs(corners).max() <= 1
    points, before = on_screen(scene.points, scene.view, width / height)
    assert np.mean(before & (np.abs(points) <= 1).all(axis=1)) > 0.9
    everything = np.concatenate([corners, points])
    assert np.abs(everything).max() > 0.9  # and it fills the picture


@pytest.mark.parametrize("make", SCENES)
def test_the_view_is_upright_and_from_above(make):
    view = build_scene(make()).view
    assert view.up @ UP > 0.8
    assert np.linalg.norm(view.up) == pytest.approx(1, abs=DIRECTION)
    towards = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    assert towards @ UP == pytest.approx(-0.5)  # 30 degrees above the horizon
    assert towards @ view.up == pytest.approx(0, abs=DIRECTION)


def test_a_wall_is_seen_from_behind_its_cameras():
    view = build_scene(walk_past_a_wall()).view
    assert view.eye[1] < 0
    assert view.target[1] > view.eye[1]


def test_frusta_stand_where_the_cameras_are_and_open_as_wide():
    scene = build_scene(walk_past_a_wall())
    vertices = scene.vertices.reshape(5, 5, 3)
    np.testing.assert_allclose(vertices[:, 0], [[i, 0, 0] for i in range(5)], atol=DIRECTION)
    top_left, _, bottom_right, _ = vertices[2, 1:] - vertices[2, 0]
    assert top_left[0] < 0 < top_left[2]  # left is -x, top is +z
    diagonal = np.linalg.norm(bottom_right - top_left)
    assert top_left[1] / diagonal == pytest.approx(FOCAL / np.hypot(WIDTH, HEIGHT))
    extent = np.linalg.norm(np.ptp(np.concatenate([scene.points, vertices[:, 0]]), axis=0))
    assert diagonal < 0.05 * extent
    assert scene.lines.shape == (40, 2)
    assert set(scene.lines[8:16].ravel()) == set(range(5, 10))  # a frustum has its own vertices


def test_cameras_may_be_left_out_and_their_path_drawn():
    bare = build_scene(walk_past_a_wall(), DrawOptions(frusta=False))
    assert (bare.lines.shape, bare.line_colors.shape) == ((0, 2), (0, 3))
    path = build_scene(walk_past_a_wall(), DrawOptions(frusta=False, path=True))
    ends = path.vertices[path.lines]
    np.testing.assert_allclose(ends[:, 0], [[i, 0, 0] for i in range(4)], atol=DIRECTION)
    np.testing.assert_allclose(ends[:, 1], [[i + 1, 0, 0] for i in range(4)], atol=DIRECTION)
    both = build_scene(walk_past_a_wall(), DrawOptions(path=True))
    assert len(both.lines) == len(both.line_colors) == 8 * 5 + 4
    for scene in (bare, path, both):
        np.testing.assert_allclose(scene.view.eye, build_scene(walk_past_a_wall()).view.eye)


def test_a_known_up_is_kept_whatever_the_cameras_say():
    view = build_scene(walk_past_a_wall(), up=-UP).view
    assert view.up @ -UP > 0.8


def test_colors_run_through_the_sequence():
    colors = sequence_colors(9)
    assert ((colors >= 0) & (colors <= 1)).all()
    assert colors[0].argmax() == 2  # blue first
    assert colors[-1].argmax() == 0  # red last
    steps = np.linalg.norm(np.diff(colors, axis=0), axis=1)
    assert steps.min() > 0.05
    scene = build_scene(walk_past_a_wall())
    np.testing.assert_array_equal(scene.line_colors[::8], sequence_colors(5))


def test_far_outliers_are_not_drawn_and_do_not_move_the_view():
    points = np.random.default_rng(1).uniform([1, 4, -1], [3, 6, 1], (500, 3))
    cameras = {f"{i}.jpg": looking([i, 0, 0], [0, 1, 0], UP) for i in range(5)}
    clean = build_scene(make_model(cameras, points))
    stray = build_scene(
        make_model(cameras, np.concatenate([points, [[900, 900, 0], [0, -1e6, 3]]]))
    )
    assert len(stray.points) == len(clean.points) == 500
    np.testing.assert_allclose(stray.view.eye, clean.view.eye, atol=0.1)


def test_points_keep_their_colors_and_get_one_where_the_model_has_none():
    cameras = {"a.jpg": looking([0, 0, 0], [0, 1, 0], UP)}
    points = np.array([[0, 5, 0], [1, 5, 0]], float)
    red_green = np.array([[255, 0, 0], [0, 51, 0]])
    scene = build_scene(make_model(cameras, points, red_green))
    np.testing.assert_allclose(scene.point_colors, [[1, 0, 0], [0, 0.2, 0]])
    for background, (color, grey) in BACKGROUNDS.items():
        options = DrawOptions(background=background)
        uncolored = build_scene(make_model(cameras, points, 0 * red_green), options)
        np.testing.assert_allclose(uncolored.point_colors, grey)
        assert abs(np.mean(color) - grey) > 0.4


def test_one_camera_without_points_can_be_drawn():
    scene = build_scene(make_model({"a.jpg": looking([1, 2, 3], [1, 0, 0], UP)}))
    assert scene.points.shape == (0, 3)
    assert np.isfinite(scene.view.eye).all()
    assert np.abs(on_screen(scene.vertices, scene.view, 1.6)[0]).max() <= 1


def test_a_model_without_poses_is_refused():
    with pytest.raises(InputError, match="no registered photo"):
        build_scene(make_model({}))


def test_the_point_size_can_be_set():
    assert build_scene(walk_past_a_wall(), DrawOptions(point_size_px=7.5)).point_size_px == 7.5


@pytest.mark.parametrize(
    "wrong",
    [
        {"width": 3},
        {"height": 100_000},
        {"point_size_px": 0},
        {"background": "pink"},
        {"coloring": "depth"},
    ],
)
def test_wrong_options_are_refused(wrong):
    with pytest.raises(ConfigError, match="got"):
        DrawOptions(**wrong)


def test_open3d_that_cannot_load_names_the_packages(monkeypatch):
    def fail(_):
        raise ImportError("libEGL.so.1: cannot open shared object file")

    monkeypatch.setattr(open3d_loader, "import_module", fail)
    with pytest.raises(DependencyError, match=r"libEGL\.so\.1.*apt-get install .*libegl1") as error:
        open3d_loader.load_open3d()
    assert "\n" not in str(error.value)


def test_open3d_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(DependencyError, match="pip install open3d"):
        open3d_loader.load_open3d()


def test_a_drawing_process_that_dies_ends_in_one_line(tmp_path, monkeypatch):
    walk_past_a_wall().write(tmp_path)
    dead = subprocess.CompletedProcess([], -6, "", "terminate called\nPostconditionPanic\n")
    monkeypatch.setattr(offscreen.subprocess, "run", lambda *_, **__: dead)
    with pytest.raises(DependencyError, match=r"without a screen.*apt-get install") as error:
        viewers.screenshot(tmp_path, tmp_path / "out.png")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out.png").exists()


def test_a_window_without_a_screen_points_to_the_screenshot(tmp_path, monkeypatch):
    if not sys.platform.startswith("linux"):
        pytest.skip("a screen is looked for on Linux only")
    walk_past_a_wall().write(tmp_path)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":9999")
    with pytest.raises(DependencyError, match=r"--screenshot|libX11"):
        viewers.view(tmp_path)


@pytest.mark.parametrize("frusta", [True, False])
def test_the_screenshot_shows_points_frusta_and_background(tmp_path, frusta):
    walk_past_a_wall().write(tmp_path)
    out = tmp_path / "pictures" / "wall.png"
    options = DrawOptions(width=320, height=200, background="white", frusta=frusta)
    try:
        viewers.screenshot(tmp_path, out, options)
    except DependencyError as error:
        pytest.skip(str(error))
    pixels = np.asarray(Image.open(out)).astype(int)
    assert pixels.shape == (200, 320, 3)
    assert (pixels[0, 0] == 255).all()
    grey = (np.abs(pixels - 128) < 30).all(axis=2)
    colored = np.ptp(pixels, axis=2) > 100
    assert grey.sum() > 200
    assert colored.sum() > 20 if frusta else colored.sum() == 0


def test_arguments_become_options(tmp_path, monkeypatch, capsys):
    drawn = {}

    def draw(*given):
        drawn.update(zip("mofu", given, strict=True))
        return ("height: 1 blue, 2 red",)

    monkeypatch.setattr(viewers, "screenshot", draw)
    parser = argparse.ArgumentParser()
    cli.add_arguments(parser)
    out = tmp_path / "out.png"
    options = ["--size", "800x600", "--point-size", "3", "--background", "white"]
    options += ["--color-by", "height", "--no-frusta", "--path"]
    args = parser.parse_args([str(tmp_path), "--screenshot", str(out), *options])
    assert cli.run(args) == 0
    assert drawn["m"] == [tmp_path]
    assert drawn["u"] is None
    assert drawn["o"] == out
    assert drawn["f"] == DrawOptions(
        width=800,
        height=600,
        point_size_px=3,
        background="white",
        coloring="height",
        frusta=False,
        path=True,
    )
    legend, wrote = capsys.readouterr().out.splitlines()
    assert legend == "height: 1 blue, 2 red"
    assert str(out) in wrote


@pytest.fixture
def several(tmp_path):
    """An output with three models, the first two of which are in east, north and up."""
    for number in (0, 1, 10):
        folder = tmp_path / "sparse" / str(number)
        folder.mkdir(parents=True)
        walk_past_a_wall().write(folder)
    write_sidecar(
        tmp_path / "sparse" / FILE_NAME,
        Sidecar(state=GeoreferenceState.METRIC, models_in_enu=(0, 1)),
    )
    return tmp_path


@pytest.mark.parametrize(
    ("more", "shown", "in_enu"),
    [
        ([], ["0", "1", "10"], False),
        (["--model", "1"], ["1"], True),
        (["--model", "10"], ["10"], 0),
    ],
)
def test_an_output_shows_all_its_models_or_one(several, monkeypatch, more, shown, in_enu):
    asked = []
    monkeypatch.setattr(viewers, "view", lambda *given: asked.append(given))
    assert main(["view", str(several), *more]) == 0
    ((models, _, up),) = asked
    assert [model.name for model in models] == shown
    assert (up is not None) == in_enu


@pytest.mark.parametrize(
    ("place", "more", "told"),
    [
        (".", ["--model", "2"], "no model 2 in its sparse/, which has 0, 1, 10"),
        ("sparse/1", ["--model", "1"], "is one model"),
        ("none", [], "no such folder"),
    ],
)
def test_a_model_that_is_not_there_is_one_line(several, capsys, place, more, told):
    assert main(["view", str(several / place), *more]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line


def test_a_size_that_is_none_is_refused(capsys):
    parser = argparse.ArgumentParser()
    cli.add_arguments(parser)
    with pytest.raises(SystemExit, match="2"):
        parser.parse_args(["model", "--size", "big"])
    assert "expected WxH" in capsys.readouterr().err


def test_reading_a_scene_does_not_load_open3d(tmp_path):
    walk_past_a_wall().write(tmp_path)
    code = (
        "import sys, pathlib; from sfm_front.storage.colmap_models import read_model;"
        "from sfm_front.viewers.model_drawing import build_scene;"
        f"build_scene(read_model(pathlib.Path({str(tmp_path)!r})));"
        "assert 'open3d' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=module_environment())
