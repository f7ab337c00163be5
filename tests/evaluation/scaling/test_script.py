"""The script that predicts how long a cluster takes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from helpers.cluster_reports import report_of
from helpers.locations import SCRIPTS

SCRIPT = SCRIPTS / "simulate_cluster.py"


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, SCRIPT, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_tables_chart_and_figures(tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    report.write_text(json.dumps(report_of(40)))
    sizes = ["--end", "4000=500", "--photos", 100, 1000, "--workers", 1, 4]
    files = ["--chart", tmp_path / "curves.png", "--json", tmp_path / "figures.json"]
    ended = run(report, "--against", report, *sizes, *files)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.count("| 40 | 1 | 101.0 |") == 2
    assert "| photos | 1 worker | 4 workers |" in ended.stdout
    assert (tmp_path / "curves.png").stat().st_size > 5000
    rows = json.loads((tmp_path / "figures.json").read_text())["simulated"]
    assert [(row["photos"], row["workers"]) for row in rows] == [
        (100, 1),
        (100, 4),
        (1000, 1),
        (1000, 4),
    ]
    assert rows[3]["wall_s"] < rows[2]["wall_s"] / 2


def test_a_mistake_is_one_line(tmp_path: Path) -> None:
    ended = run(tmp_path / "nowhere.json")
    assert ended.returncode == 2
    assert ended.stderr.startswith("simulate_cluster: ")
    assert ended.stderr.count("\n") == 1
    assert (
        "--end: '0=3' is not PHOTOS=SECONDS"
        in run(tmp_path / "nowhere.json", "--end", "0=3").stderr
    )
