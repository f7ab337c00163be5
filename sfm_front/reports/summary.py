"""The result of a run in words."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any


def closing_summary(report: dict[str, Any], output: Path) -> str:
    """The result in words, from the content of ``report.json``."""
    totals = report["totals"]
    lines = [
        f"{totals['registered']} of {totals['photos']} photos registered in "
        f"{_plural(totals['models'], 'model')}, {clock(totals['wall_seconds'])}"
    ]
    for model in report["models"]:
        lines.append(
            f"  {output / model['path']}: {model['registered']} photos, "
            f"{model['points3D']} points, {model['mean_reprojection_error_px']:.2f} px"
        )
    photos = max(totals["photos"], 1)
    stages = ", ".join(
        f"{stage} {seconds / photos:.3f}" for stage, seconds in totals["seconds_by_stage"].items()
    )
    lines.append(
        f"seconds a photo: {totals['wall_seconds'] / photos:.2f} in all; by stage, "
        f"side by side in part: {stages}"
    )
    by_quarter = totals["median_seconds_by_quarter"]
    if len(by_quarter) == 4:
        lines.append(
            "work on a photo, global refinement apart, median by quarter of the run: "
            + ", ".join(f"{seconds:.2f} s" for seconds in by_quarter)
        )
    lines += _reasons(
        "skipped",
        [
            (row["name"], ": ".join(filter(None, row["skipped"].values())))
            for row in report["photos"]
            if row["skipped"]
        ],
    )
    lines += _reasons(
        "not registered",
        [
            (row["name"], row["why_not_registered"])
            for row in report["photos"]
            if not row["skipped"] and not row["registered"]
        ],
    )
    if not report["models"]:
        lines.append(
            "no model could be built: take photos that overlap by two thirds and more, "
            "from different places"
        )
    return "\n".join(lines)


def _reasons(what: str, rows: list[tuple[str, str]]) -> list[str]:
    """Every file with its reason, or how often each reason came where there are many."""
    if not rows:
        return []
    if len(rows) <= 20:
        return [f"{what}:", *(f"  {name}: {why}" for name, why in rows)]
    counted = Counter(why for _, why in rows).most_common(10)
    return [
        f"{what}: {len(rows)} photos (each in report.json)",
        *(f"  {count} × {why}" for why, count in counted),
    ]


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def clock(seconds: float) -> str:
    """Minutes and seconds, or hours as well: 1:05, 2:00:07."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
