"""What the workers of a cluster did, and what was given up."""

from __future__ import annotations

from sfm_front.reports.cluster_outcome import ClusterOutcome
from sfm_front.reports.html.markup import Html, joined, section, table, tag
from sfm_front.reports.html.material import Material
from sfm_front.reports.words import counted

_TASKS = {
    "describe": "describing photos",
    "match": "matching photos",
    "grow": "growing models of groups",
    "join": "joining models of groups",
}


def workers(material: Material) -> Html | None:
    """None of a session of one process."""
    cluster = material.summary.cluster
    if cluster is None:
        return None
    return section(
        "workers",
        "Workers",
        _by_worker(cluster),
        _by_kind(cluster),
        tag("p", _in_words(cluster), class_="note"),
        _given_up(cluster),
    )


def _by_worker(cluster: ClusterOutcome) -> Html:
    rows = [
        (
            worker.name,
            worker.tasks,
            f"{worker.busy_seconds:.1f}",
            f"{worker.waiting_seconds:.1f}",
            _megabytes(worker.bytes_in),
            _megabytes(worker.bytes_out),
        )
        for worker in cluster.workers
    ]
    return table(("worker", "tasks", "busy, s", "waiting, s", "MB in", "MB out"), rows)


def _by_kind(cluster: ClusterOutcome) -> Html:
    rows = [
        (
            _TASKS.get(kind.kind, kind.kind),
            kind.count,
            kind.items,
            kind.reused,
            f"{kind.seconds:.1f}",
            f"{kind.longest_seconds:.1f}",
            _megabytes(kind.bytes_in),
            _megabytes(kind.bytes_out),
        )
        for kind in cluster.tasks
    ]
    head = ("work", "tasks", "photos", "found done", "seconds", "longest", "MB in", "MB out")
    return table(head, rows)


def _in_words(cluster: ClusterOutcome) -> str:
    serial = ", ".join(f"{stage} {s:.1f} s" for stage, s in cluster.serial_seconds.items())
    files = "by path in a shared folder" if cluster.shared_storage else "sent"
    page = f" Its dashboard: {cluster.dashboard}." if cluster.dashboard else ""
    return (
        f"Scheduler {cluster.scheduler}.{page} Features went {files}. Groups of "
        f"{cluster.group_size} photos. Work was handed out for "
        f"{cluster.distributed_seconds:.1f} s; {counted(cluster.lost, 'task')} begun again. The "
        f"coordinator meanwhile: {serial}."
    )


def _given_up(cluster: ClusterOutcome) -> Html | None:
    if not cluster.failed:
        return None
    items = [
        tag(
            "li",
            f"{_TASKS.get(task.kind, task.kind)}: {task.reason}; {', '.join(task.photos)}",
        )
        for task in cluster.failed
    ]
    return joined([tag("h3", "Given up"), tag("ul", joined(items))])


def _megabytes(number: int) -> str:
    return f"{number / 1e6:.1f}"
