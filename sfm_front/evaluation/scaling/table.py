"""What a simulation says, as a table and as curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from sfm_front.evaluation.reconstruction.chart import check_matplotlib, save_figure
from sfm_front.evaluation.scaling.costs import ClusterRun
from sfm_front.evaluation.scaling.simulation import Prediction

# By number of photos and of workers.
Predictions = Mapping[tuple[int, int], Prediction]


def format_predictions(predictions: Predictions) -> str:
    """Markdown: a line per number of photos, a column per number of workers. In brackets how many
    times faster than with the fewest workers."""
    photos, workers = _axes(predictions)
    lines = [
        "| photos | " + " | ".join(_counted(number, "worker") for number in workers) + " |",
        "|---" * (len(workers) + 1) + "|",
    ]
    for num_photos in photos:
        row = [predictions[num_photos, number] for number in workers]
        cells = [f"{_duration(one.wall_s)} ({row[0].wall_s / one.wall_s:.1f}x)" for one in row]
        lines.append(f"| {num_photos} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def format_check(measured: Sequence[tuple[ClusterRun, Prediction]]) -> str:
    """Markdown: what was measured beside what the simulation says."""
    lines = [
        "| photos | workers | measured, s | simulated, s | difference |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {run.num_photos} | {run.num_workers} | {run.wall_seconds:.1f} | {said.wall_s:.1f} "
        f"| {said.wall_s / run.wall_seconds - 1:+.1%} |"
        for run, said in measured
    ]
    return "\n".join(lines)


def write_curves(predictions: Predictions, out: Path) -> None:
    """How many times faster, by number of workers, a curve per number of photos.

    ``out`` has any extension that matplotlib writes. Raises DependencyError without it, and
    InputError if the file cannot be written.
    """
    check_matplotlib()
    from matplotlib.figure import Figure

    photos, workers = _axes(predictions)
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.subplots()
    axes.plot(workers, [n / workers[0] for n in workers], color="#c9ced6", linestyle="--")
    for num_photos in photos:
        base = predictions[num_photos, workers[0]].wall_s
        speedups = [base / predictions[num_photos, number].wall_s for number in workers]
        (line,) = axes.plot(workers, speedups, marker="o", markersize=4)
        axes.annotate(
            f"{num_photos}",
            (workers[-1], speedups[-1]),
            textcoords="offset points",
            xytext=(6, -3),
            fontsize=8,
            color=line.get_color(),
        )
    axes.set_xscale("log", base=2)
    axes.set_yscale("log", base=2)
    axes.set_xticks(workers, [str(number) for number in workers])
    axes.set_yticks(workers, [str(number) for number in workers])
    axes.set_xlim(workers[0] * 0.9, workers[-1] * 1.5)
    axes.set_xlabel("workers")
    axes.set_ylabel(f"times as fast as {_counted(workers[0], 'worker')}")
    axes.set_title("Simulated, by number of photos", fontsize=10)
    axes.spines[["top", "right"]].set_visible(False)
    save_figure(figure, out)


def _axes(predictions: Predictions) -> tuple[list[int], list[int]]:
    return sorted({key[0] for key in predictions}), sorted({key[1] for key in predictions})


def _counted(number: int, thing: str) -> str:
    return f"{number} {thing}" + ("" if number == 1 else "s")


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 100 * 60:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h" if seconds >= 36000 else f"{seconds / 3600:.1f} h"
