"""The examples do what they say, run as a reader would run them."""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.locations import SCRIPTS, VILLAGE

pytestmark = pytest.mark.slow

EXAMPLES = SCRIPTS / "examples"
NAMES = [path.name for path in sorted((VILLAGE / "images").iterdir())[:6]]
SUMMARY = re.compile(r"registered (\d+) of (\d+).*models: (\d+)")


def run_example(script: str, *arguments: object) -> str:
    command = [sys.executable, EXAMPLES / script, *arguments]
    done = subprocess.run(map(str, command), capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def copy_photos(folder: Path, names: list[str]) -> None:
    folder.mkdir(exist_ok=True)
    for name in names:
        shutil.copy(VILLAGE / "images" / name, folder / name)


def summary(printed: str) -> tuple[int, ...]:
    found = SUMMARY.search(printed.splitlines()[-1])
    assert found is not None, printed
    return tuple(map(int, found.groups()))


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("village")
    copy_photos(folder, NAMES)
    return folder


@pytest.fixture(scope="module")
def reconstructed(photos, tmp_path_factory):
    """The output folder, and what was printed on the way to it."""
    output = tmp_path_factory.mktemp("outputs") / "village"
    return output, run_example("reconstruct_folder.py", photos, output, "--max-image-size", 800)


def test_reconstruct_folder_prints_the_registered_photos_and_models(reconstructed):
    output, printed = reconstructed
    assert summary(printed) == (len(NAMES), len(NAMES), 1)
    model, registered = printed.splitlines()[-3:-1]
    assert model.startswith(f"{output / 'sparse' / '0'}: {len(NAMES)} photos")
    assert registered.strip().split(", ") == NAMES
    assert (output / "sparse" / "0" / "points3D.bin").is_file()


def test_reconstruct_folder_tells_what_is_wrong_with_an_output(reconstructed, photos):
    output, _ = reconstructed
    command = [sys.executable, str(EXAMPLES / "reconstruct_folder.py"), str(photos), str(output)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    assert "holds a reconstruction already" in done.stderr
    assert "Traceback" not in done.stderr


def test_live_loop_places_photos_that_come_after_it_has_begun(tmp_path):
    arriving = tmp_path / "arriving"
    copy_photos(arriving, NAMES[:3])
    command = [sys.executable, EXAMPLES / "live_loop.py", arriving, tmp_path / "out", "--idle", "4"]
    with subprocess.Popen(map(str, command), stdout=subprocess.PIPE, text=True) as loop:
        assert loop.stdout is not None
        printed = [loop.stdout.readline()]
        copy_photos(arriving, NAMES[3:])
        (arriving / "notes.txt").write_text("no photo")
        printed += loop.stdout.readlines()
        assert loop.wait(300) == 0
    *steps, _ = printed
    assert [step.split(":")[0] for step in steps] == NAMES
    placed = [name for step in steps for name in NAMES if name in step.split("placed")[1]]
    assert sorted(placed) == NAMES
    assert summary("".join(printed)) == (len(NAMES), len(NAMES), 1)


def test_live_loop_ends_when_nothing_comes(tmp_path):
    (tmp_path / "empty").mkdir()
    started = time.monotonic()
    printed = run_example("live_loop.py", tmp_path / "empty", tmp_path / "out", "--idle", 0.5)
    assert time.monotonic() - started < 60
    assert summary(printed) == (0, 0, 0)


def test_own_descriptor_prints_another_photo_for_each(photos):
    lines = run_example("own_descriptor.py", photos).splitlines()
    found = [re.fullmatch(r"(\S+): (\S+) \((\d\.\d+)\)", line) for line in lines]
    assert [match and match[1] for match in found] == NAMES
    for match in found:
        assert match[2] in set(NAMES) - {match[1]}
        assert 0 < float(match[3]) < 1


def test_the_colour_histogram_tells_colours_apart_and_not_their_places():
    part = runpy.run_path(str(EXAMPLES / "own_descriptor.py"))["ColourHistogram"]()
    red, blue = np.array([250, 10, 10], np.uint8), np.array([10, 10, 250], np.uint8)
    red_left, red_right, all_blue = (
        part.describe(np.tile(np.array(colours), (40, 30, 1)))
        for colours in ([red, blue, blue], [blue, blue, red], [blue, blue, blue])
    )
    assert red_left.shape == (part.dimension,)
    assert red_left.dtype == np.float32
    assert red_left @ red_right == pytest.approx(1)
    # The square root of the two thirds that are blue.
    assert red_left @ all_blue == pytest.approx((2 / 3) ** 0.5)


def test_read_report_has_a_row_for_each_photo(reconstructed):
    output, _ = reconstructed
    header, *rows = (
        re.split(r"\s{2,}", line) for line in run_example("read_report.py", output).splitlines()
    )
    assert header == ["photo", "registered", "most relevant", "verified pairs", "seconds"]
    assert [row[0] for row in rows] == NAMES
    assert {row[1] for row in rows} == {"yes"}
    assert rows[0][2:4] == ["-", "0"]
    for number, row in enumerate(rows[1:], 1):
        assert row[2] in NAMES[:number]
        assert 1 <= int(row[3]) <= number
        assert float(row[4]) > 0


def test_read_report_tells_what_is_missing(tmp_path):
    command = [sys.executable, str(EXAMPLES / "read_report.py"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert done.stderr.strip().endswith("Give the output of a finished session.")
