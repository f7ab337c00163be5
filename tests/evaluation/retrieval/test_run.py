"""The whole retrieval benchmark, and its script."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from helpers import photo_files
from helpers.locations import SCRIPTS
from helpers.model_building import model_of

from sfm_front.errors import ConfigError
from sfm_front.evaluation.retrieval.run import RetrievalSettings, run

SCRIPT = SCRIPTS / "benchmark_retrieval.py"


def pool_of(folder):
    """Two scenes; models that say that each one's photos share points."""
    for seed in (1, 2):
        names = [f"{seed}_{shift}.png" for shift in (0, 40, 80)]
        photo_files.save(folder / str(seed) / "images", *names)
        model = folder / str(seed) / "sparse" / "0"
        model.mkdir(parents=True)
        model_of(25 * [tuple(names)]).write(model)
    return folder


def test_the_whole_run(tmp_path):
    settings = RetrievalSettings(
        datasets=[f"pool:{pool_of(tmp_path / 'pool')}"],
        methods=["phash", "exhaustive"],
        threads=1,
        cache=tmp_path / "cache",
        max_features=300,
        scale=20,
        num_queries=4,
    )
    phash, exhaustive = run(settings, lambda _: None)
    assert (phash.method, exhaustive.method) == ("phash", "exhaustive")
    assert (exhaustive.dataset, exhaustive.indexed) == ("pool pool", 20)
    assert exhaustive.accuracy.num_queries == 4
    assert exhaustive.accuracy.mean_average_precision == 1


def test_the_script_writes_what_it_prints(tmp_path):
    pool = pool_of(tmp_path / "pool")
    done = subprocess.run(
        [
            *(sys.executable, SCRIPT, f"pool:{pool}", "--methods", "phash,exhaustive"),
            *("--cache", tmp_path / "cache", "--threads", "1", "--max-features", "200"),
            *("--json", tmp_path / "a.json", "--csv", tmp_path / "a.csv"),
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "pool pool" in done.stdout
    told = json.loads((tmp_path / "a.json").read_text())
    assert [one["method"] for one in told["outcomes"]] == ["phash", "exhaustive"]
    assert told["settings"]["threads"] == 1
    assert (
        "P@1,0." in (tmp_path / "a.csv").read_text() or "P@1,1" in (tmp_path / "a.csv").read_text()
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--methods", "psychic"], "no retrieval method is called 'psychic'"),
        (["--methods", "phash,phash"], "each once"),
        (["--methods", "phash", "--threads", "0"], "threads must be at least 1"),
        (["--methods", "phash", "--scale", "0"], "scale must be at least 1"),
        (["--weights", "lenet=file"], "give NETWORK=FILE"),
        (["--methods", "phash"], "no scene in it"),
    ],
)
def test_the_script_refuses_before_it_runs(tmp_path, arguments, message):
    done = subprocess.run(
        [sys.executable, SCRIPT, f"pool:{tmp_path}", *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_settings_name_what_is_wrong(tmp_path):
    with pytest.raises(ConfigError, match="name at least one method"):
        RetrievalSettings(datasets=["pool:x"], methods=[], threads=1, cache=tmp_path)
