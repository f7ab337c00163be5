"""The reconstruction benchmark as a bar chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sfm_front.errors import DependencyError, InputError
from sfm_front.evaluation.reconstruction.benchmark import OURS, SIFT_ALONE, Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_OURS_COLOR, _RIVAL_COLOR, _YARDSTICK_COLOR = "#d1495b", "#7d93a8", "#c9ced6"


def check_matplotlib() -> None:
    """Raise ``DependencyError`` if charts cannot be drawn: before an hour of runs, not after."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise DependencyError(f"{error}: a chart needs it; pip install matplotlib") from error


def write_chart(rows: Sequence[Row], out: Path) -> None:
    """One panel per scene, one bar per method: seconds, and the number of registered photos.

    ``out`` has any extension that matplotlib writes: png, svg, pdf. Raises ``DependencyError``
    without matplotlib and ``InputError`` if the file cannot be written.
    """
    check_matplotlib()
    from matplotlib.figure import Figure

    scenes = list(dict.fromkeys(row.scene.name for row in rows))
    columns = min(3, len(scenes))
    lines = -(-len(scenes) // columns)
    height = 0.9 + 0.34 * max(len(_of(rows, scene)) for scene in scenes)
    figure = Figure(figsize=(max(6.4, 4.6 * columns), height * lines), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    for panel in panels[len(scenes) :]:
        panel.set_visible(False)
    for panel, scene in zip(panels, scenes, strict=False):
        shown = _of(rows, scene)[::-1]  # matplotlib counts bars from below
        seconds = [row.means()["seconds"] or 0.0 for row in shown]
        bars = panel.barh(
            [row.method for row in shown], seconds, color=[_color(row) for row in shown]
        )
        panel.bar_label(bars, [_label(row) for row in shown], padding=3, fontsize=8)
        panel.set_xlim(0, 1.35 * max(seconds))
        panel.set_title(f"{scene}, {shown[0].scene.num_photos} photos", fontsize=10)
        panel.tick_params(labelsize=8)
        panel.spines[["top", "right"]].set_visible(False)
    figure.supxlabel("seconds, whole run; in brackets: registered photos", fontsize=8)
    save_figure(figure, out)


def save_figure(figure: Figure, out: Path) -> None:
    """Write ``figure`` to the file ``out``; folders are created.

    Raises ``InputError`` if the file cannot be written or its extension is unknown.
    """
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(out, dpi=160)
    except (OSError, ValueError) as error:
        raise InputError(f"{out}: cannot write the chart ({error})") from error


def _of(rows: Sequence[Row], scene: str) -> list[Row]:
    return [row for row in rows if row.scene.name == scene]


def _color(row: Row) -> str:
    return {OURS: _OURS_COLOR, SIFT_ALONE: _YARDSTICK_COLOR}.get(row.method, _RIVAL_COLOR)


def _label(row: Row) -> str:
    means = row.means()
    seconds = f"{means['seconds'] or 0.0:.1f}"
    registered = means.get("registered")
    return seconds if registered is None else f"{seconds} ({registered:g})"
