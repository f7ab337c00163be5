"""The options of a file and of flags together, as ``reconstruct --print-config`` prints them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sfm_front.cli.config_file import as_toml, read_options
from sfm_front.cli.main import main
from sfm_front.georeference.control.options import ControlOptions
from sfm_front.matching.guided_matching import GuidedOptions
from sfm_front.photos.cameras import CameraOptions
from sfm_front.photos.positions import PositionOptions
from sfm_front.session.options import SessionOptions

DEFAULT = SessionOptions()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "options.toml"


def printed(capsys: pytest.CaptureFixture[str], tmp_path: Path, *arguments: object) -> object:
    """The options that ``reconstruct --print-config`` prints."""
    assert main(["reconstruct", "--print-config", *map(str, arguments)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    file = tmp_path / "printed.toml"
    file.write_text(out)
    return read_options(file)


def test_the_defaults_are_printed_without_a_folder(capsys, tmp_path):
    assert printed(capsys, tmp_path) == DEFAULT


def test_a_folder_without_photos_is_not_looked_at(capsys, tmp_path):
    assert printed(capsys, tmp_path, tmp_path / "none", "--seed", 3) == SessionOptions(seed=3)
    assert list(tmp_path.iterdir()) == [tmp_path / "printed.toml"]


def test_a_file_is_applied(capsys, tmp_path, file):
    changed = SessionOptions(
        seed=9, weights=Path("s\u00fcd flug.pth"), guided=GuidedOptions(max_ratio=1e-9)
    )
    file.write_text(as_toml(changed))
    assert printed(capsys, tmp_path, "--config", file) == changed


def test_flags_win_over_the_file_and_leave_the_rest(capsys, tmp_path, file):
    file.write_text(
        "max_features = 11\nmax_image_size = 800\nseed = 5\ntext = true\n"
        "[retrieval]\ncandidates = 3\nnum_expansion = 2\n"
        "[pair_matching]\nnum_matched = 5\nnum_matched_first = 4\n"
        '[cameras]\nmode = "single"\nmodel = "PINHOLE"\n'
        '[positions]\nsource = "off"\nvertical_sigma_m = 7\n'
    )
    of_file = read_options(file)
    flags = (
        *("--max-features", 12, "--seed", 0, "--no-text", "--candidates", 6),
        *("--num-matched", 7, "--camera-mode", "per-image"),
        *("--gps", "geo.txt"),
    )
    assert printed(capsys, tmp_path, "--config", file, *flags) == replace(
        of_file,
        max_features=12,
        seed=0,
        text=False,
        retrieval=replace(of_file.retrieval, candidates=6),
        pair_matching=replace(of_file.pair_matching, num_matched=7),
        cameras=CameraOptions(mode="per-image", model="PINHOLE"),
        positions=PositionOptions(source="geo.txt", vertical_sigma_m=7.0),
    )


def test_a_quality_wins_over_the_file_and_flags_win_over_it(capsys, tmp_path, file):
    file.write_text("max_image_size = 1000\nmax_features = 11\n")
    draft = printed(capsys, tmp_path, "--config", file, "--quality", "draft")
    assert draft == SessionOptions(max_image_size=800, max_features=2000)
    high = printed(capsys, tmp_path, "--quality", "high", "--max-features", 12)
    assert high == SessionOptions(max_image_size=2400, max_features=12)
    assert printed(capsys, tmp_path, "--quality", "normal") == DEFAULT


def test_file_and_flags_may_each_have_a_part_of_what_control_points_need(capsys, tmp_path, file):
    file.write_text("[control_points]\nmarked_size = [4000, 3000]\n")
    both = ControlOptions(file=Path("gcp.txt"), marked_size=(4000, 3000))
    given = printed(capsys, tmp_path, "--config", file, "--gcp", "gcp.txt")
    assert given == SessionOptions(control_points=both)
    assert main(["reconstruct", "--print-config", "--config", str(file)]) == 2
    assert "--gcp-size says how control points are" in capsys.readouterr().err
    file.write_text('[control_points]\nfile = "gcp.txt"\n')
    given = printed(capsys, tmp_path, "--config", file, "--gcp-size", "4000,3000")
    assert given == SessionOptions(control_points=both)


@pytest.mark.parametrize(("given", "vertical_m"), [("0.5", 1.0), ("0.5,3", 3.0)])
def test_the_accuracy_of_positions_is_one_number_or_two(capsys, tmp_path, given, vertical_m):
    positions = PositionOptions(horizontal_sigma_m=0.5, vertical_sigma_m=vertical_m)
    assert printed(capsys, tmp_path, "--gps-accuracy", given) == replace(
        DEFAULT, positions=positions
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("5,10,15", "--gps-accuracy takes one or two numbers, got 3"),
        ("5m", "--gps-accuracy takes numbers separated by commas, got '5m'"),
        ("0", "horizontal_sigma_m must be a number of metres above 0, got 0.0"),
    ],
)
def test_an_accuracy_that_cannot_be_is_one_line_and_status_2(capsys, given, message):
    assert main(["reconstruct", "--print-config", "--gps-accuracy", given]) == 2
    assert capsys.readouterr() == ("", f"sfm-front reconstruct: {message}\n")


def test_a_mistake_in_the_file_is_one_line_and_status_2(capsys, tmp_path, file):
    file.write_text("sed = 1\n")
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.png").touch()
    output = tmp_path / "out"
    folder = str(tmp_path / "photos")
    assert main(["reconstruct", folder, "--output", str(output), "--config", str(file)]) == 2
    message = f"sfm-front reconstruct: {file}: sed: no such key; did you mean seed?\n"
    assert capsys.readouterr() == ("", message)
    assert not output.exists()


@pytest.mark.parametrize("place", [0, 2, 4, 5])
def test_the_folder_may_stand_anywhere(capsys, tmp_path, place):
    arguments = ["--seed", "1", "--threads", "1", "--text"]
    arguments.insert(place, str(tmp_path / "none"))
    assert main(["reconstruct", *arguments]) == 2
    assert "none: no such folder" in capsys.readouterr().err
