"""The result of a run in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from sfm_front.reports.camera_outcome import camera_warnings
from sfm_front.reports.cluster_outcome import ClusterOutcome
from sfm_front.reports.control_words import control_lines
from sfm_front.reports.run_summary import AuditOutcome, RunSummary, Totals
from sfm_front.reports.words import clock, counted, one_line

# Photos of a doubtful group; report.json names all.
_MOST_NAMED = 5


def closing_summary(
    summary: RunSummary, output: Path, *, watched: bool = False, with_stages: bool = False
) -> str:
    """What a user reads at the end of a run that wrote to ``output``: first of all the verdict.

    ``watched``: photos arrived one by one, so that their latency means something to the user.
    ``with_stages``: whether to say how long each stage took.
    """
    # Here, for they load pycolmap, and the command line reads this file before it may be loaded.
    from sfm_front.reports.georeference_words import georeference_lines
    from sfm_front.reports.verdict import verdict

    totals = summary.totals
    lines = [verdict(summary, summary.sidecar).sentence]
    for model in summary.models:
        lines.append(
            f"  {output / model.path}: {counted(model.num_registered, 'photo')}, "
            f"{counted(model.num_points, 'point')}, {model.mean_reprojection_error_px:.2f} px"
        )
        if model.audit and model.audit.is_doubtful:
            lines.append(f"    {_doubt(model.audit)}")
        lines += [f"    {line}" for line in camera_warnings(summary.cameras, model.path)]
    if summary.georeference is not None:
        lines += georeference_lines(summary.georeference)
    if summary.control_points is not None:
        lines += control_lines(summary.control_points)
    lines += _reasons("skipped", [(photo.name, str(photo), "") for photo in summary.skipped])
    lines += _reasons(
        "in no model",
        [
            (photo.name, photo.why_not or "", photo.hint)
            for photo in summary.used
            if photo.model is None
        ],
    )
    for groups in summary.look_alikes:
        first, second = map(_named, groups)
        lines.append(f"taken for one place and taken apart, look-alikes: {first} and {second}")
    if summary.cluster is not None:
        lines += _cluster(summary.cluster)
    photos = max(totals.num_photos, 1)
    lines.append(
        f"it took {clock(totals.wall_seconds)}, {totals.wall_seconds / photos:.2f} s a photo"
    )
    if watched and totals.latency:
        latency = totals.latency
        lines.append(
            f"from arrival to pose: median {latency.median_s:.2f} s, "
            f"95 % within {latency.p95_s:.2f} s, worst {latency.worst_s:.2f} s"
        )
    if with_stages:
        lines += _stages(totals)
    return "\n".join(map(one_line, lines))


def _cluster(cluster: ClusterOutcome) -> list[str]:
    """What is given up is named; report.html has the rest."""
    busy = sum(worker.busy_seconds for worker in cluster.workers)
    waiting = sum(worker.waiting_seconds for worker in cluster.workers)
    lines = [
        f"{counted(len(cluster.workers), 'worker')}: busy {clock(busy)}, waiting {clock(waiting)}"
    ]
    for task in cluster.failed[:20]:
        lines.append(f"  given up: {task.kind} {_named(task.photos)}: {task.reason}")
    return lines


def _stages(totals: Totals) -> list[str]:
    photos = max(totals.num_photos, 1)
    stages = ", ".join(
        f"{stage} {seconds / photos:.3f}" for stage, seconds in totals.seconds_by_stage.items()
    )
    lines = [f"seconds a photo by stage, which overlap: {stages}"]
    by_quarter = totals.median_seconds_by_quarter
    if len(by_quarter) == 4:
        lines.append(
            "work per photo without global refinement, median by quarter of the run: "
            + ", ".join(f"{seconds:.2f} s" for seconds in by_quarter)
        )
    return lines


def _doubt(audit: AuditOutcome) -> str:
    """What speaks against a model; the photos named are those of the smaller group."""
    return (
        f"doubtful: {audit.num_contradicted} of its {audit.num_pairs} pairs, with "
        f"{audit.contradicted_share:.1%} of the matches, contradict it; look first at "
        + _named(audit.worst_groups[-1])
    )


def _named(names: Sequence[str]) -> str:
    return ", ".join(names[:_MOST_NAMED]) + (", ..." if len(names) > _MOST_NAMED else "")


def _reasons(what: str, rows: list[tuple[str, str, str]]) -> list[str]:
    """Every file with its reason and what would help, or how often each reason came where there
    are many."""
    if not rows:
        return []
    if len(rows) <= 20:
        lines = [f"{what}:"]
        for name, why, hint in rows:
            lines.append(f"  {name}: {why}")
            if hint:
                lines.append(f"    {hint}")
        return lines
    counted = Counter(why for _, why, _ in rows).most_common(10)
    return [
        f"{what}: {len(rows)} photos (each in report.json)",
        *(f"  {count} × {why}" for why, count in counted),
    ]
