"""Seconds a photo by stage, as stacked areas of uPlot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from viser import uplot

from sfm_front.reports.html.stage_times import OTHER, STAGE_GROUPS
from sfm_front.reports.story import PhotoStory
from sfm_front.types import Float64Array

# More photos share columns.
_MOST_COLUMNS = 300
_COLORS = {
    "reading": "#64748b",
    "features": "#3b82f6",
    "retrieval": "#06b6d4",
    "matching": "#22c55e",
    "mapping": "#eab308",
    "adjustment": "#f97316",
    "writing": "#a855f7",
    OTHER: "#94a3b8",
}


def series() -> tuple[uplot.Series, ...]:
    """Of ``columns``: the highest area first, so that the others lie over it."""
    areas = [
        uplot.Series(label=group, stroke=color, fill=color, width=1, points={"show": False})
        for group, color in reversed(_COLORS.items())
    ]
    return (uplot.Series(label="photo"), *areas)


def columns(photos: Sequence[PhotoStory]) -> tuple[Float64Array, ...]:
    """The photo's number, then for each series the top of its area, in seconds.

    Stages of ``photos`` that were added, in order; of many, several share a column: their mean.
    """
    known = {stage: group for group, stages in STAGE_GROUPS.items() for stage in stages}
    groups = list(_COLORS)
    seconds = np.zeros((len(groups), max(len(photos), 1)))
    for place, photo in enumerate(photos):
        for stage, spent in photo.seconds.items():
            seconds[groups.index(known.get(stage, OTHER)), place] += spent
    per_column = -(-seconds.shape[1] // _MOST_COLUMNS)
    starts = np.arange(0, seconds.shape[1], per_column)
    counts = np.diff([*starts, seconds.shape[1]])
    tops = np.cumsum(np.add.reduceat(seconds, starts, axis=1) / counts, axis=0)
    return (starts + 1.0, *tops[::-1])
