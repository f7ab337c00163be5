"""The retrieval benchmark as a bar chart: mean average precision and time per query."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sfm_front.evaluation.reconstruction.chart import check_matplotlib, save_figure
from sfm_front.evaluation.retrieval.benchmark import Outcome

_OURS_COLOR, _RIVAL_COLOR = "#d1495b", "#7d93a8"


def write_chart(outcomes: Sequence[Outcome], out: Path, highlighted: Sequence[str] = ()) -> None:
    """Two panels per dataset, one bar per method, best mAP first; ``highlighted`` methods are red.

    Milliseconds are on a logarithmic axis. Raises ``DependencyError`` without matplotlib and
    ``InputError`` if the file cannot be written.
    """
    check_matplotlib()
    from matplotlib.figure import Figure

    datasets = list(dict.fromkeys(outcome.dataset for outcome in outcomes))
    shown = {name: _by_precision(outcomes, name) for name in datasets}
    heights = [0.8 + 0.3 * len(shown[name]) for name in datasets]
    figure = Figure(figsize=(9, 0.4 + sum(heights)), layout="constrained")
    panels = figure.subplots(len(datasets), 2, squeeze=False, height_ratios=heights)
    for (precise, fast), name in zip(panels, datasets, strict=True):
        rows = shown[name][::-1]  # matplotlib counts bars from below
        methods = [row.method for row in rows]
        colors = [_OURS_COLOR if row.method in highlighted else _RIVAL_COLOR for row in rows]
        precisions = [_precision(row) for row in rows]
        milliseconds = [1000 * row.seconds for row in rows]
        labels = precise.barh(methods, precisions, color=colors)
        precise.bar_label(labels, fmt="%.3f", padding=3, fontsize=8)
        precise.set_xlim(0, 1.15)
        precise.set_title(f"{name}, {rows[0].indexed} photos: mAP", fontsize=10)
        labels = fast.barh(methods, milliseconds, color=colors)
        shown_ms = [f"{ms:.0f}" if ms >= 100 else f"{ms:.2g}" for ms in milliseconds]
        fast.bar_label(labels, shown_ms, padding=3, fontsize=8)
        fast.set_xscale("log")
        fast.set_xlim(min(milliseconds) / 2, 5 * max(milliseconds))
        fast.set_yticks([])
        fast.set_title("milliseconds per query", fontsize=10)
        for panel in (precise, fast):
            panel.tick_params(labelsize=8)
            panel.spines[["top", "right"]].set_visible(False)
    save_figure(figure, out)


def _by_precision(outcomes: Sequence[Outcome], dataset: str) -> list[Outcome]:
    of_dataset = (outcome for outcome in outcomes if outcome.dataset == dataset)
    return sorted(of_dataset, key=_precision, reverse=True)


def _precision(outcome: Outcome) -> float:
    return outcome.accuracy.mean_average_precision if outcome.accuracy else 0.0
