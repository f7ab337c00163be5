"""What is left of the keypoints where a lens's model does not reach: mean residuals over the photo.

Random errors cancel out in a cell's mean; a pattern says that the camera model is too simple.
"""

from __future__ import annotations

import numpy as np
import pycolmap

from sfm_front.reports.html.charts import nice_step, number, svg
from sfm_front.reports.html.markup import Html, figure, joined, tag
from sfm_front.reports.html.observations import Observations
from sfm_front.reports.html.plan import arrow
from sfm_front.types import Float64Array

_WIDTH = 520
# Cells along the long side, and observations that make a mean.
_CELLS = 18
_LEAST = 8
# Of a cell: the arrow of nine in ten is shorter.
_USUAL = 0.8


def residual_grid(
    model: pycolmap.Reconstruction, observations: Observations, camera_id: int
) -> Html | None:
    """Of one camera; None if it has too few observations."""
    camera = model.cameras[camera_id]
    ours = np.array(
        [model.images[i].camera_id == camera_id for i in observations.image_ids.tolist()]
    )[observations.photo] & np.isfinite(observations.residuals_px).all(axis=1)
    xy, residuals = observations.xy[ours], observations.residuals_px[ours]
    side = max(camera.width, camera.height) / _CELLS
    columns, rows = round(camera.width / side) or 1, round(camera.height / side) or 1
    size = np.array([camera.width, camera.height])
    cells = np.clip(xy / size * [columns, rows], 0, [columns - 1, rows - 1]).astype(np.int64)
    counts, means = _means(cells, residuals, (rows, columns))
    filled = counts >= _LEAST
    if filled.sum() < 4:
        return None
    lengths = np.linalg.norm(means[filled], axis=1)
    px_per_cell = _WIDTH / columns * min(1.0, camera.width / camera.height)
    height = _WIDTH * camera.height / camera.width
    scale = px_per_cell * _USUAL / max(float(np.percentile(lengths, 90)), 1e-9)
    places = np.argwhere(filled)
    starts = (places[:, ::-1] + 0.5) / [columns, rows] * [_WIDTH, height]
    ends = starts + means[filled] * scale
    drawing = svg(
        _WIDTH,
        height + 26,
        tag("rect", x=0.5, y=0.5, width=_WIDTH - 1, height=number(height - 1), class_="field"),
        tag(
            "g",
            joined(arrow(*a, *b) for a, b in zip(starts.tolist(), ends.tolist(), strict=True)),
            class_="residuals",
        ),
        _key(scale, height),
        label=f"residuals of camera {camera_id}",
    )
    words = (
        f"Camera {camera_id}, {camera.model_name}: mean residual by place on the photo, from "
        f"{int(ours.sum())} observations; largest {lengths.max():.2f} px, "
        f"mean {lengths.mean():.2f} px."
    )
    return figure(drawing, words)


def _means(
    cells: np.ndarray, residuals: Float64Array, shape: tuple[int, int]
) -> tuple[np.ndarray, Float64Array]:
    """(rows, columns) observations and (rows, columns, 2) mean residuals in each cell."""
    rows, columns = shape
    index = cells[:, 1] * columns + cells[:, 0]
    counts = np.bincount(index, minlength=rows * columns)
    sums = np.stack(
        [np.bincount(index, axis, minlength=rows * columns) for axis in residuals.T], axis=-1
    )
    means = sums / np.maximum(counts, 1)[:, None]
    return counts.reshape(shape), means.reshape(*shape, 2)


def _key(scale: float, height: float) -> Html:
    """How long an arrow of some pixels is."""
    pixels = nice_step(60 / scale, 1)
    y = number(height + 16)
    end = 8 + pixels * scale
    label = tag("text", f"{pixels:g} px", x=number(end + 8), y=number(height + 20))
    line = tag("path", d=f"M8 {y}H{number(end)}")
    return tag("g", line, label, class_="key")
