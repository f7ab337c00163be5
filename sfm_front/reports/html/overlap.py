"""How many photos see each place of what was photographed."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from PIL import Image

from sfm_front.reports.html.charts import legend, number, svg
from sfm_front.reports.html.ground import (
    Ground,
    Sheet,
    facing_plane,
    ground_of,
    image_on,
    marks,
    sheet_around,
)
from sfm_front.reports.html.markup import Html, figure, joined, picture, tag
from sfm_front.reports.html.material import Material
from sfm_front.reports.html.observations import IntArray, Observations
from sfm_front.types import Float64Array

# So many photos at least, and the colour; red to blue stay apart for those who see no green.
_CLASSES = (
    (1, (202, 60, 60)),
    (3, (240, 150, 80)),
    (5, (246, 214, 120)),
    (7, (120, 190, 190)),
    (10, (38, 112, 168)),
)
ENOUGH = 5
"""Photos that should see a place."""

_MIDDLE = (1.0, 99.0)
# Points in a cell, in the mean, and how many cells there are at all.
_POINTS_PER_CELL = 6.0
_NUM_CELLS = (150, 12_000)


def overlap(material: Material) -> Html | None:
    """None without points."""
    observations = material.observations
    if observations is None or len(observations.xyz) < _NUM_CELLS[0]:
        return None
    is_level = material.flight is not None
    ground = ground_of(observations, is_enu=True) if is_level else facing_plane(observations)
    flat = ground.flat(observations.xyz)
    low, high = np.percentile(flat[:, :2], _MIDDLE, axis=0)
    inside = ((flat[:, :2] >= low) & (flat[:, :2] <= high)).all(axis=1)
    sheet = sheet_around(np.array([low, high]))
    counts = _photos_by_cell(sheet, flat, inside, observations)
    seen = counts[counts > 0]
    enough = float((seen >= ENOUGH).mean()) if len(seen) else 0.0
    drawing = svg(
        sheet.width,
        sheet.height,
        image_on(sheet, picture(_drawn(counts), lossless=True), class_="cells"),
        _cameras(sheet, ground, observations) if is_level else None,
        marks(sheet, ground),
        label="overlap",
    )
    entries = [
        (f"overlap-{least}", label) for (least, _), label in zip(_CLASSES, _labels(), strict=True)
    ]
    words = (
        f"How many photos see a place, by the points they share. {enough:.0%} of what is seen at "
        f"all is seen by {ENOUGH} photos or more."
    )
    side = "" if is_level else " On the plane in which the points spread most."
    return figure(joined([drawing, legend(entries)]), words + side, class_="plan")


def _photos_by_cell(
    sheet: Sheet, flat: Float64Array, inside: np.ndarray, observations: Observations
) -> IntArray:
    """(rows, columns) photos that see a point in each cell of the sheet."""
    num_cells = float(np.clip(inside.sum() / _POINTS_PER_CELL, *_NUM_CELLS))
    side = np.sqrt(sheet.width * sheet.height / num_cells)
    columns, rows = int(sheet.width // side), int(sheet.height // side)
    places = sheet.pixels(flat) / [sheet.width / columns, sheet.height / rows]
    cell = np.floor(places).astype(np.int64)
    kept = inside[observations.point]
    x, y = cell[observations.point[kept]].T
    # A photo counts once in a cell, whatever number of its points it sees.
    num_photos = len(observations.image_ids)
    seen = np.unique((y * columns + x) * num_photos + observations.photo[kept])
    counts = np.bincount(seen // num_photos, minlength=rows * columns)
    return counts.astype(np.int64).reshape(rows, columns)


def _drawn(counts: IntArray) -> Image.Image:
    picture = np.zeros((*counts.shape, 4), np.uint8)
    for least, color in _CLASSES:
        picture[counts >= least] = (*color, 255)
    return Image.fromarray(picture)


def _labels() -> list[str]:
    firsts = [least for least, _ in _CLASSES]
    ranges = [f"{low}–{high - 1}" for low, high in pairwise(firsts)]
    return [*ranges, f"{firsts[-1]} and more photos"]


def _cameras(sheet: Sheet, ground: Ground, observations: Observations) -> Html:
    pixels = sheet.pixels(ground.flat(observations.centres)).tolist()
    dots = (tag("circle", cx=number(x), cy=number(y), r=2.6) for x, y in pixels)
    return tag("g", joined(dots), class_="stations")
