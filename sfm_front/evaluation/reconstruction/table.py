"""The reconstruction benchmark as text."""

from __future__ import annotations

from collections.abc import Sequence

from sfm_front.evaluation.poses import AUC_THRESHOLDS_DEG
from sfm_front.evaluation.reconstruction.benchmark import OURS, Row

_NONE = "-"


def format_table(rows: Sequence[Row]) -> str:
    """One table of all rows, followed by why runs failed.

    Speed-up is ours: a method's seconds over ours on the same scene, if both built a model; for
    OpenCV's SIFT alone it shows how close ours is to that bound. A photo's seconds are those of
    its stages, which overlap between photos. ``registered`` is in the largest model, ``all`` in
    any; AUC and pairs joined are in percent.
    """
    ours = {
        row.scene.name: row.means()["seconds"]
        for row in rows
        if row.method == OURS and row.means()["models"]
    }
    cells = [_cells(row, ours.get(row.scene.name)) for row in rows]
    header = [
        name for name in cells[0] if any(line[name] != _NONE for line in cells)
    ]  # empty columns are left out
    lines = [header, *([line[name] for name in header] for line in cells)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
    text = [aligned(lines[0], widths), "  ".join("-" * width for width in widths)]
    for row, before, line in zip(rows, [rows[0], *rows], lines[1:], strict=False):
        if row.scene.name != before.scene.name:
            text.append("")
        text.append(aligned(line, widths))
    text += [f"{row.scene.name}, {row.method}: {reason}" for row in rows for reason in row.failures]
    return "\n".join(text)


def format_profile(row: Row) -> str:
    """Where the seconds of ``row`` go: its stages, longest first, with their share of the total.

    Shares add up to more than 100 % because stages overlap.
    """
    whole = row.means()["seconds"] or 0.0
    stages = row.stage_means()
    longest_first = sorted(stages.items(), key=lambda stage: -stage[1])
    width = max((len(stage) for stage in stages), default=0)
    return "\n".join(
        [
            f"{row.scene.name}, {row.method}: {whole:.1f} s",
            *(
                f"  {stage:<{width}} {seconds:8.2f} s {100 * seconds / whole:5.1f} %"
                for stage, seconds in longest_first
            ),
        ]
    )


def _cells(row: Row, ours_seconds: float | None) -> dict[str, str]:
    means = row.means()
    seconds = means["seconds"]
    speed_up = None
    if seconds is not None and ours_seconds is not None and means.get("models") != 0:
        speed_up = seconds / ours_seconds
    memory = means.get("peak_memory_bytes")
    cells = {
        "scene": row.scene.name,
        "method": row.method,
        "seconds": _number(seconds, ".1f"),
        "speed-up": _number(speed_up, ".2f"),
        "photo median s": _number(means["photo_seconds_median"], ".2f"),
        "p95 s": _number(means["photo_seconds_p95"], ".2f"),
        "memory MiB": _number(None if memory is None else memory / 2**20, ".0f"),
        "registered": _count(means.get("registered"), row.scene.num_photos),
        "all": _count(means.get("registered_in_all")),
        "models": _count(means.get("models")),
        "points": _number(means.get("points"), ".0f"),
        "error px": _number(means.get("reprojection_error_px"), ".2f"),
    }
    for threshold in AUC_THRESHOLDS_DEG:
        area = means.get(f"auc_{threshold:g}deg")
        cells[f"AUC@{threshold:g}"] = _number(None if area is None else 100 * area, ".1f")
    joined = means.get("pairs_joined")
    cells["pairs joined"] = _number(None if joined is None else 100 * joined, ".1f")
    return cells


def _number(value: float | None, form: str) -> str:
    return _NONE if value is None else format(value, form)


def _count(value: float | None, whole: int | None = None) -> str:
    """A mean of counts, without decimals if it is an integer."""
    if value is None:
        return _NONE
    text = f"{value:.0f}" if value == int(value) else f"{value:.1f}"
    return text if whole is None else f"{text}/{whole}"


def aligned(line: Sequence[str], widths: Sequence[int]) -> str:
    """A line of cells padded to ``widths``: two names flush left, numbers flush right."""
    return "  ".join(
        text.ljust(width) if column < 2 else text.rjust(width)
        for column, (text, width) in enumerate(zip(line, widths, strict=True))
    ).rstrip()
