"""Whole runs: the same models as in one process, and what workers did in the report."""

from __future__ import annotations

import json
import os
import signal
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.clustering import GROUPS, run, village

from sfm_front.cluster.connection import Cluster
from sfm_front.cluster.coordinator import ClusterProgress
from sfm_front.events import Event, PhotoAdded, PhotoArrived, PhotoPlaced
from sfm_front.reports.report_json import read_report

pytestmark = pytest.mark.slow


def test_groups_become_one_model_and_the_report_says_who_did_what(
    processes: Cluster, tmp_path: Path
) -> None:
    told: list[Event] = []
    seen: list[ClusterProgress] = []
    result = run(
        processes, tmp_path / "out", village(), on_event=told.append, on_progress=seen.append
    )
    assert [model.num_registered for model in result.models] == [21]
    of_type = Counter(type(event) for event in told)
    assert of_type[PhotoArrived] == of_type[PhotoAdded] == of_type[PhotoPlaced] == 21
    assert seen[-1].num_placed == 21
    assert seen[-1].num_grown == seen[-1].num_groups == 2
    found = read_report(tmp_path / "out").cluster
    assert found is not None
    assert {kind.kind: kind.items for kind in found.tasks} == {
        "describe": 21,
        "match": 21,
        "grow": sum(group.photos for group in found.groups),
    }
    assert sum(worker.tasks for worker in found.workers) == sum(kind.count for kind in found.tasks)
    assert all(kind.bytes_in > 0 and kind.bytes_out > 0 for kind in found.tasks)
    assert found.shared_storage
    assert found.failed == ()
    assert not (tmp_path / "out" / "cluster").exists()


def test_a_worker_that_dies_costs_its_task_and_nothing_else(
    processes: Cluster, tmp_path: Path
) -> None:
    first, _ = processes.client.run(os.getpid).values()
    killed: list[int] = []

    def kill(now: ClusterProgress) -> None:
        if now.num_matched >= 6 and not killed:
            killed.append(first)
            os.kill(first, signal.SIGKILL)

    result = run(processes, tmp_path / "out", village(), on_progress=kill)
    assert killed == [first]
    assert [model.num_registered for model in result.models] == [21]
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["cluster"]["failed"] == []
    assert {row["kind"]: row["items"] for row in report["cluster"]["tasks"]}["match"] == 21


def test_features_are_sent_where_no_folder_is_shared(
    processes: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("all_see_token", "all_see_photo"):
        monkeypatch.setattr(f"sfm_front.cluster.coordinator.{name}", lambda *_: False)
    result = run(processes, tmp_path / "out", village())
    assert [model.num_registered for model in result.models] == [21]
    found = result.summary.cluster
    assert found is not None
    assert not found.shared_storage
    photos = sum(photo.path.stat().st_size for photo in village())
    by_kind = {kind.kind: kind for kind in found.tasks}
    assert by_kind["describe"].bytes_in > photos


def test_workers_join_groups_two_at_a_time(processes: Cluster, tmp_path: Path) -> None:
    options = replace(GROUPS, group_size=10)  # the least: five photos each, by four groups
    result = run(processes, tmp_path / "out", village(), options=options)
    assert [model.num_registered for model in result.models] == [21]
    found = result.summary.cluster
    assert found is not None
    assert [group.is_join for group in found.groups].count(True) == 2
    assert {kind.kind: kind.count for kind in found.tasks}["join"] == 2
