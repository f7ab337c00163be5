"""Milliseconds a photo by stage, as photos came."""

from __future__ import annotations

import numpy as np

from sfm_front.reports.html.charts import Series, legend, nice_step, stacked_areas
from sfm_front.reports.html.markup import Html, figure, joined
from sfm_front.reports.html.material import Material
from sfm_front.reports.run_summary import PhotoOutcome

# Columns of the chart; beyond, each is the mean of several photos.
_MOST_COLUMNS = 300

# What a reader tells apart → stages as sessions time them. The first run ahead, beside the turns of
# earlier photos.
STAGE_GROUPS = {
    "reading": ("read",),
    "features": ("sift", "vlad", "network"),
    "retrieval": ("retrieve", "rerank"),
    "matching": ("match", "verify", "guide"),
    "mapping": ("locate", "map"),
    "adjustment": ("refine",),
    "writing": ("store",),
}
OTHER = "other"


def stage_times(material: Material) -> Html | None:
    """None without photos that were used."""
    photos = material.summary.used
    if not photos:
        return None
    layers = [layer for layer in _layers(photos) if layer.values.any()]
    per_column = -(-len(photos) // _MOST_COLUMNS)
    columns = [Series(layer.label, _binned(layer.values, per_column)) for layer in layers]
    step = max(int(nice_step(len(photos), 8)), 1)
    ticks = [
        ((photo - 0.5) / per_column, str(photo)) for photo in range(step, len(photos) + 1, step)
    ]

    def title(column: int) -> str:
        first = column * per_column
        name = photos[first].name
        rows = [f"{layer.label} {layer.values[column]:.0f} ms" for layer in reversed(columns)]
        return "\n".join([name, *rows])

    drawing = stacked_areas(
        columns,
        title="milliseconds a photo by stage",
        xlabel="photo, in order of arrival",
        ylabel="ms",
        ticks=ticks,
        column_title=title,
    )
    medians = ", ".join(f"{layer.label} {np.median(layer.values):.0f} ms" for layer in layers)
    words = f"Milliseconds a photo by stage. Reading and features run ahead. Medians: {medians}."
    entries = [(f"layer-{place}", layer.label) for place, layer in enumerate(layers)]
    return figure(joined([drawing, legend(entries)]), words, class_="wide")


def _layers(photos: list[PhotoOutcome]) -> list[Series]:
    known = {stage: group for group, stages in STAGE_GROUPS.items() for stage in stages}
    values = {group: np.zeros(len(photos)) for group in (*STAGE_GROUPS, OTHER)}
    for place, photo in enumerate(photos):
        for stage, seconds in photo.seconds.items():
            values[known.get(stage, OTHER)][place] += 1000 * seconds
    return [Series(group, of_photos) for group, of_photos in values.items()]


def _binned(values: np.ndarray, per_bin: int) -> np.ndarray:
    """Means of so many in a row."""
    starts = np.arange(0, len(values), per_bin)
    counts = np.minimum(starts + per_bin, len(values)) - starts
    means: np.ndarray = np.add.reduceat(values, starts) / counts
    return means
