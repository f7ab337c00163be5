"""The command line: help, exit status, and one line for every mistake."""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from helpers.locations import ROOT
from PIL import Image

from sfm_front.cli import reconstruct, retrieve
from sfm_front.cli.main import main
from sfm_front.cli.reconstruct_arguments import session_options
from sfm_front.cluster.options import ClusterOptions
from sfm_front.georeference.control.options import ControlOptions
from sfm_front.search.folder_search import SearchOptions
from sfm_front.session.options import SessionOptions, available_cores
from sfm_front.session.quality import QUALITIES

HEAVY = ("torch", "pycolmap", "cv2", "open3d", "faiss")


def run_in_process_of_its_own(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        *([name, "--help"] for name in ("reconstruct", "retrieve", "view", "export")),
        ["--version"],
    ],
)
def test_help_loads_nothing_heavy(arguments):
    code = (
        "import sys\n"
        "from sfm_front.cli.main import main\n"
        f"try: main({arguments})\n"
        "except SystemExit as stop: assert not stop.code\n"
        f"print('loaded', [name for name in {HEAVY} if name in sys.modules])"
    )
    done = run_in_process_of_its_own("-c", code)
    assert done.stderr == ""
    assert done.stdout.splitlines()[-1] == "loaded []"


def test_the_script_is_the_command():
    done = run_in_process_of_its_own("scripts/reconstruct.py", "--help")
    assert done.returncode == 0
    assert "--max-image-size" in done.stdout


def parser(command: ModuleType = reconstruct) -> argparse.ArgumentParser:
    made = argparse.ArgumentParser()
    command.add_arguments(made)
    return made


SESSION = SessionOptions()
# The help does not read these: the modules that hold them load heavy libraries.
DEFAULTS = {
    "--max-image-size": SESSION.max_image_size,
    "--max-features": SESSION.max_features,
    "--global-descriptor": SESSION.global_descriptor,
    "--candidates": SESSION.retrieval.candidates,
    "--device": SESSION.device,
    "--threads": "all" if SESSION.threads == available_cores() else SESSION.threads,
}
DEFAULTS_OF = {
    reconstruct: DEFAULTS
    | {
        "--quality": next(
            name
            for name, quality in QUALITIES.items()
            if (quality.max_image_size, quality.max_features)
            == (SESSION.max_image_size, SESSION.max_features)
        ),
        "--seed": SESSION.seed,
        "--camera-mode": SESSION.cameras.mode,
        "--camera-model": SESSION.cameras.model,
        "--gps": SESSION.positions.source,
        "--gps-accuracy": "5,10; without V, twice H",
        "--georegister": SESSION.georegister,
        "--gcp-accuracy": "0.02,0.03; without V, twice H",
        "--num-matched": SESSION.pair_matching.num_matched,
        "--snapshot-seconds": f"{SESSION.snapshot_seconds:g}",
        "--cache-mb": "a quarter of the machine's memory, at most 2048",
        "--group-size": ClusterOptions(address="local:1").group_size,
    },
    retrieve: DEFAULTS | {"--method": SearchOptions().method},
}


@pytest.mark.parametrize("command", [reconstruct, retrieve])
def test_help_tells_the_defaults_of_the_options_and_no_others(command):
    told = {}
    for action in parser(command)._actions:
        # What argparse fills in is the command's own; outputs/NAME follows from the folder.
        text = (action.help or "").replace("(default: outputs/NAME", "").replace("%(default)s", "")
        if "default" in text.replace("(default: )", ""):
            (found,) = re.findall(r"\(default: ([^)]*)\)|(\S+) \(default\)", text)
            told[action.option_strings[0]] = "".join(found)
    assert told == {option: str(value) for option, value in DEFAULTS_OF[command].items()}


def test_help_has_the_numbers_of_the_qualities():
    (told,) = (a.help for a in parser()._actions if a.dest == "quality")
    for name in ("draft", "high"):
        quality = QUALITIES[name]
        assert f"{quality.max_image_size} px, {quality.max_features} features" in told


def test_the_seed_is_the_sessions_where_none_is_given():
    options = session_options(parser().parse_args(["folder"]))
    assert options.seed == options.verification.seed == SessionOptions().seed


def test_what_is_not_given_is_the_sessions_default():
    arguments = parser().parse_args(["folder"])
    assert session_options(arguments) == SessionOptions(atlas=session_options(arguments).atlas)


def test_models_stay_in_their_own_frame_where_that_is_wanted():
    given = parser().parse_args(["folder", "--georegister", "off"])
    assert session_options(given).georegister == "off"


def test_control_points_are_taken_as_given():
    given = ("--gcp", "gcp.txt", "--gcp-size", "4272,2848", "--gcp-accuracy", "0.5")
    assert session_options(parser().parse_args(given)).control_points == ControlOptions(
        file=Path("gcp.txt"),
        marked_size=(4272, 2848),
        horizontal_sigma_m=0.5,
        vertical_sigma_m=1.0,
    )


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """A folder with one photo; a good one is not needed where the options are wrong."""
    folder = tmp_path / "photos"
    folder.mkdir()
    Image.new("RGB", (200, 150), (10, 20, 30)).save(folder / "a.png")
    return folder


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one line on stderr of a command that ends with status 2."""
    assert main([str(argument) for argument in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    assert err.endswith("\n")
    return line


def test_a_folder_that_is_missing(tmp_path, capsys):
    line = refused(capsys, "reconstruct", tmp_path / "none", "--output", tmp_path / "out")
    assert line.startswith(f"sfm-front reconstruct: {tmp_path / 'none'}: no such folder")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_a_link_to_itself(tmp_path, capsys):
    (tmp_path / "loop").symlink_to("loop")
    line = refused(capsys, "reconstruct", tmp_path / "loop")
    assert "loop: cannot be read (" in line


def test_a_folder_without_photos(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "notes.txt").write_text("no photo")
    line = refused(capsys, "reconstruct", tmp_path / "empty", "--output", tmp_path / "out")
    assert "no photo in it or its sub-folders" in line
    assert not (tmp_path / "out").exists()


def test_a_file_in_place_of_a_folder(photo, tmp_path, capsys):
    line = refused(capsys, "reconstruct", photo / "a.png", "--output", tmp_path / "out")
    assert "a.png: not a folder" in line


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--camera-params", "1000,500"], "camera params of SIMPLE_RADIAL are 4 numbers"),
        (["--camera-params", "1000,a,b,0"], "--camera-params takes numbers"),
        (["--camera-params=-5,100,75,0"], "focal lengths must be above 0"),
        (["--camera-params", "100,nan,75,0"], "camera params must be finite numbers"),
        (["--camera-model", "PINHOLE", "--camera-params", "9,9,9"], "camera params of PINHOLE"),
        (["--camera-model", "BOX"], "camera model must be auto or one of"),
        (["--camera-mode", "one"], "camera mode must be one of auto, single"),
        (["--order", "size"], "order must be one of name, time, random, got size"),
        (["--max-features", "0"], "max_features must be at least 1, got 0"),
        (["--max-image-size", "10"], "max_image_size must be at least"),
        (["--candidates", "0"], "candidates must be at least 1, got 0"),
        (["--matched", "0"], "matched must be at least 1, got 0"),
        (["--threads", "0"], "threads must be at least 1, got 0"),
        (["--gcp", "none.txt"], "none.txt: cannot be read: No such file"),
        (["--gcp-accuracy", "1,2,3"], "--gcp-accuracy takes one or two numbers, got 3"),
        (["--gcp-accuracy", "0"], "horizontal_sigma_m must be a number above 0"),
        (["--gcp-size", "4000"], "--gcp-size takes width and height, got '4000'"),
        (["--gcp-size", "4000,2.5"], "--gcp-size takes width and height, got '4000,2.5'"),
        (["--gcp-size", "inf,inf"], "--gcp-size takes width and height, got 'inf,inf'"),
        (["--gcp-size", "4000,3000"], "--gcp-size says how control points are: give them with"),
        (["--gcp-accuracy", "0.1"], "--gcp-accuracy says how control points are: give them"),
        (["--gcp", "none.txt", "--georegister", "off"], "leave georegister = off out"),
        (["--global-descriptor", "bag"], "no global descriptor is called 'bag'"),
        (["--global-descriptor", "vlad", "--weights", "none.pth"], "--weights goes with one"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_options_that_cannot_be(photo, tmp_path, capsys, given, message):
    line = refused(capsys, "reconstruct", photo, "--output", tmp_path / "out", *given)
    assert message in line
    assert line.startswith("sfm-front reconstruct: ")
    assert not (tmp_path / "out").exists()


def test_control_points_of_other_photos(photo, tmp_path, capsys):
    file = tmp_path / "gcp.txt"
    marks = [f"9.{i} 48.{i * i} 300 10 10 {name}" for i in range(3) for name in ("x.jpg", "y.jpg")]
    file.write_text("\n".join(["EPSG:4326", *marks]))
    line = refused(capsys, "reconstruct", photo, "--output", tmp_path / "out", "--gcp", file)
    assert "0 control points have marks in two or more of the photos given" in line
    assert "x.jpg, for one, is not among the photos" in line
    assert not (tmp_path / "out").exists()


def test_names_that_text_models_would_cut(photo, tmp_path, capsys):
    (photo / "a.png").rename(photo / "a b.png")
    line = refused(capsys, "reconstruct", photo, "--output", tmp_path / "out", "--text")
    assert "'a b.png'" in line
    assert not (tmp_path / "out").exists()


def test_weights_that_are_not_there(photo, tmp_path, capsys):
    line = refused(
        capsys,
        *("reconstruct", photo, "--output", tmp_path / "out"),
        *("--global-descriptor", "mobilenet_v2", "--weights", tmp_path / "none.pth"),
    )
    assert "none.pth" in line


def test_an_output_whose_database_is_damaged(photo, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "database.db").write_bytes(b"kept")
    (tmp_path / "out" / "retrieval.jsonl").touch()
    line = refused(capsys, "reconstruct", photo, "--output", tmp_path / "out")
    assert "database.db: file is not a database. It is damaged: give --overwrite" in line
    assert (tmp_path / "out" / "database.db").read_bytes() == b"kept"


def test_an_output_that_is_a_file(photo, tmp_path, capsys):
    (tmp_path / "out").write_bytes(b"kept")
    line = refused(capsys, "reconstruct", photo, "--output", tmp_path / "out", "--overwrite")
    assert "not a folder" in line
    assert (tmp_path / "out").read_bytes() == b"kept"


def test_a_wrong_option_does_not_cost_the_reconstruction_that_is_there(photo, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "database.db").write_bytes(b"kept")
    (tmp_path / "out" / "retrieval.jsonl").touch()
    refused(
        capsys,
        *("reconstruct", photo, "--output", tmp_path / "out", "--overwrite"),
        *("--max-features", "0"),
    )
    assert (tmp_path / "out" / "database.db").read_bytes() == b"kept"


def test_a_model_to_view_that_is_missing(tmp_path, capsys):
    line = refused(capsys, "view", tmp_path / "none")
    assert line.startswith(f"sfm-front view: {tmp_path / 'none'}: no such folder")


def test_a_session_without_a_model_yet(tmp_path, capsys):
    (tmp_path / "database.db").touch()
    line = refused(capsys, "view", tmp_path)
    assert line.endswith("the same reconstruct command goes on")


def test_what_a_command_does_not_know_leads_to_its_own_help(capsys):
    with pytest.raises(SystemExit):
        main(["view", "outputs/a", "--nosuch\x1b"])
    assert capsys.readouterr().err == (
        "sfm-front view: unrecognized arguments: --nosuch\\x1b; see sfm-front view --help\n"
    )


@pytest.mark.parametrize("arguments", [[], ["rebuild"], ["reconstruct"], ["reconstruct", "a", "b"]])
def test_what_is_no_command_is_status_2(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("sfm-front")
    assert line.endswith(" --help")


def test_ctrl_c_is_no_traceback(monkeypatch, capsys):
    def interrupted(_arguments: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(reconstruct, "run", interrupted)
    assert main(["reconstruct", "folder"]) == 130
    assert capsys.readouterr().err == "\ninterrupted\n"
