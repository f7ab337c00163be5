"""Reports of runs on a cluster in which everything cost a round number."""

from __future__ import annotations

from typing import Any

from sfm_front.evaluation.scaling.costs import ClusterRun
from sfm_front.reports.cluster_outcome import cluster_of_row


def report_of(
    num_photos: int, *, end_s: float = 1.0, group_size: int = 20, lost: int = 0
) -> dict[str, Any]:
    """As ``report.json`` has it: one worker; a photo is described in 0.5 s, matched in 0.25 s,
    grown in 0.1 s and joined in 0.04 s, with 3, 1, 0.5 and 0.5 MB; groups overlap by a quarter."""
    in_groups = num_photos * 5 // 4
    kinds = (("describe", num_photos, 0.5, 3), ("match", num_photos, 0.25, 1))
    tasks = [
        {
            "kind": kind,
            "count": 2,
            "items": items,
            "reused": 0,
            "seconds": 1.1 * seconds * items,
            "cpu_seconds": seconds * items,
            "longest_seconds": seconds * items,
            "bytes_in": round(megabytes * 1e6) * items,
            "bytes_out": 0,
        }
        for kind, items, seconds, megabytes in (
            *kinds,
            ("grow", in_groups, 0.1, 0.5),
            ("join", in_groups, 0.04, 0.5),
        )
    ]
    group = {"registered": 9, "models": 1, "seconds": 1.0, "bytes_in": 0, "bytes_out": 0}
    return {
        "totals": {"photos": num_photos, "wall_seconds": 100.0 + end_s},
        "end": {"seconds": {"finish": end_s}},
        "cluster": {
            "scheduler": "tcp://127.0.0.1:8786",
            "dashboard": None,
            "shared_storage": True,
            "group_size": group_size,
            "distributed_seconds": 97.5,
            "serial_seconds": {"retrieve": 0.1, "store": 0.2, "cut": 0.5},
            "tasks": tasks,
            "workers": [
                {
                    "name": "one",
                    "tasks": 6,
                    "busy_seconds": 90.0,
                    "waiting_seconds": 7.5,
                    "bytes_in": 0,
                    "bytes_out": 0,
                }
            ],
            "groups": [
                {**group, "photos": in_groups // 2, "is_join": False},
                {**group, "photos": in_groups // 2, "is_join": False},
                {**group, "photos": in_groups, "is_join": True},
            ],
            "lost": lost,
            "failed": [],
        },
    }


def measured(num_photos: int, **others: Any) -> ClusterRun:
    """The same, as it is read."""
    report = report_of(num_photos, **others)
    outcome = cluster_of_row(report["cluster"])
    assert outcome is not None
    totals, end_s = report["totals"], sum(report["end"]["seconds"].values())
    return ClusterRun(num_photos, 1, totals["wall_seconds"], end_s, outcome)
