"""The command itself, killed in the middle, and given again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.locations import SCRIPTS, VILLAGE
from helpers.reconstructing import FAST

pytestmark = pytest.mark.slow


def command(output: Path, *more: str) -> list[str]:
    script = str(SCRIPTS / "reconstruct.py")
    where = [str(VILLAGE / "images"), "--output", str(output), "--cluster", "local:2"]
    return [sys.executable, script, *where, "--group-size", "12", *FAST, *more]


def children(pid: int) -> set[int]:
    """Processes that it started, and theirs."""
    found: set[int] = set()
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(entry.read_text().rpartition(")")[2].split()[1])
        except OSError:  # It has just ended.
            continue
        if parent == pid:
            child = int(entry.parent.name)
            found |= {child} | children(child)
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_coordinator_that_is_killed_takes_its_workers_along_and_is_gone_on_with(
    tmp_path: Path,
) -> None:
    output = tmp_path / "out"
    with subprocess.Popen(
        command(output, "--events", "-"), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout is not None
        added = 0
        for line in process.stdout:
            added += json.loads(line)["event"] == "photo_added"
            if added == 5:
                break
        workers = children(process.pid)
        os.kill(process.pid, signal.SIGKILL)
    assert len(workers) >= 2
    waited = time.monotonic() + 300
    while any(Path(f"/proc/{pid}").exists() for pid in workers):
        assert time.monotonic() < waited, "workers outlive their coordinator"
        time.sleep(0.1)
    again = subprocess.run(command(output, "--json"), capture_output=True, text=True, check=True)
    assert json.loads(again.stdout)["totals"]["registered"] == 21
    report = json.loads((output / "report.json").read_text())
    items = {row["kind"]: row["items"] for row in report["cluster"]["tasks"]}
    assert items["match"] <= 21 - 5
    names = [json.loads(line) for line in (output / "events.jsonl").read_text().splitlines()]
    stored = [event["name"] for event in names if event["event"] == "photo_added"]
    assert len(stored) == len(set(stored)) == 21


@pytest.mark.skipif(sys.platform == "win32", reason="no process groups")
def test_ctrl_c_reaches_the_coordinator_alone_and_twice_leaves_nothing_behind(
    tmp_path: Path,
) -> None:
    with subprocess.Popen(
        command(tmp_path / "out", "--events", "-"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        workers: set[int] = set()
        for line in process.stdout:
            if json.loads(line)["event"] == "photo_added" and not workers:
                workers = children(process.pid)
                os.killpg(process.pid, signal.SIGINT)
                time.sleep(1)
                os.killpg(process.pid, signal.SIGINT)
        told = process.stderr.read()
    assert process.returncode in (130, -signal.SIGINT)
    assert "stopping: finishing with the photos taken so far" in told
    assert "Traceback" not in told
    waited = time.monotonic() + 300
    while any(Path(f"/proc/{pid}").exists() for pid in workers):
        assert time.monotonic() < waited, "workers outlive their coordinator"
        time.sleep(0.1)
