"""The script, as it is run."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import pytest
from helpers.locations import SAMPLES, SCRIPTS, VILLAGE


def tune(*arguments, cwd):
    return subprocess.run(
        [sys.executable, SCRIPTS / "tune.py", *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["gided-ratio"], "did you mean guided-ratio?"),
        (["guided.max_rato", "--values", "1"], "did you mean guided.max_ratio?"),
        (["verification.min_inliers"], "give some with --values"),
        (["guided-ratio", "rerank-floor", "--values", "1"], "--values goes with one NAME"),
        (["guided-ratio", "--values", "high"], "a number, got 'high'"),
        (["guided-ratio", "--scenes", "vilage"], "did you mean village?"),
        (["guided-ratio", "--arrangements", "half,reversed"], "no arrangement reversed"),
        (["guided-ratio", "--threads", "0"], "threads must be at least 1"),
    ],
)
def test_mistakes_end_in_one_line(tmp_path, arguments, message):
    done = tune(*arguments, "--data", SAMPLES, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_an_option_is_tried_on_real_photos(tmp_path):
    images = tmp_path / "data" / "few" / "images"
    images.mkdir(parents=True)
    for photo in sorted((VILLAGE / "images").iterdir())[:4]:
        shutil.copy(photo, images)
    shutil.copytree(VILLAGE / "gt", images.parent / "gt")
    done = tune(
        *("guided-ratio", "--values", "0.6", "--arrangements", "name"),
        *("--data", "data", "--cache", "cache", "--json", "all.json"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("1 of 1 scenes, 4 photos")
    assert "few: tried in" in done.stderr
    (option,) = json.loads((tmp_path / "all.json").read_text(encoding="utf-8"))["options"]
    assert (option["path"], option["current"]) == ("guided.max_ratio", 0.7)
    assert [trial["value"] for trial in option["trials"]] == [0.6, 0.7]
    for trial in option["trials"]:
        assert (trial["scene"], trial["photos"]) == ("few", 4)
        assert trial["quality"]["registered"] == 4
        assert trial["quality"]["auc"][2] > 0.9
