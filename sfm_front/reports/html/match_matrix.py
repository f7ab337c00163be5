"""Which photos match which, and how well."""

from __future__ import annotations

import numpy as np
from PIL import Image

from sfm_front.reports.html.charts import nice_step, number, svg
from sfm_front.reports.html.markup import Html, figure, joined, picture, tag
from sfm_front.reports.html.material import Material
from sfm_front.types import Float64Array

_SIDE, _MARGIN = 520, 44
# A cell for each photo up to here; beyond, cells of several show their best pair.
_MOST_CELLS = 1000
# Few inliers to many.
_STOPS = np.array(
    [[68, 60, 132], [49, 104, 142], [33, 145, 140], [94, 201, 98], [253, 221, 37]], np.float64
)


def match_matrix(material: Material) -> Html | None:
    """None without verified pairs."""
    pairs = material.session.pairs
    if not len(pairs):
        return None
    order = {photo.image_id: place for place, photo in enumerate(material.session.photos)}
    count = len(order)
    per_cell = -(-count // _MOST_CELLS)
    cells = -(-count // per_cell)
    inliers = np.zeros((cells, cells))
    places = np.array([[order[first], order[second]] for first, second, _ in pairs.tolist()])
    for first, second in ((0, 1), (1, 0)):
        np.maximum.at(
            inliers, (places[:, first] // per_cell, places[:, second] // per_cell), pairs[:, 2]
        )
    low, high = float(pairs[:, 2].min()), float(pairs[:, 2].max())
    drawing = svg(
        _SIDE + _MARGIN + 6,
        _SIDE + 66,
        _image(inliers, low, high),
        _axes(count),
        _color_bar(low, high),
        label="match matrix",
    )
    words = (
        f"Verified matches of every pair of photos, in order of arrival: {len(pairs)} pairs of "
        f"{count * (count - 1) // 2}, {np.median(pairs[:, 2]):.0f} inliers in the median pair."
    )
    return figure(drawing, words, class_="matrix")


def _image(inliers: Float64Array, low: float, high: float) -> Html:
    pixels = np.zeros((*inliers.shape, 4), np.uint8)
    there = inliers > 0
    pixels[there, :3] = _colors(np.log(inliers[there] / low) / max(np.log(high / low), 1e-9))
    pixels[there, 3] = 255
    return joined(
        [
            tag("rect", x=_MARGIN, y=0, width=_SIDE, height=_SIDE, class_="field"),
            tag(
                "image",
                href=picture(Image.fromarray(pixels), lossless=True),
                x=_MARGIN,
                y=0,
                width=_SIDE,
                height=_SIDE,
                class_="cells",
            ),
        ]
    )


def _axes(count: int) -> Html:
    step = max(int(nice_step(count, 5)), 1)
    texts = []
    for photo in [1, *range(step, count + 1, step)] if step > 1 else range(1, count + 1):
        at = (photo - 0.5) / count * _SIDE
        x, y = number(_MARGIN + at), number(at + 4)
        texts.append(tag("text", photo, x=x, y=_SIDE + 16, text_anchor="middle"))
        texts.append(tag("text", photo, x=_MARGIN - 6, y=y, text_anchor="end"))
    return joined(texts)


def _color_bar(low: float, high: float) -> Html:
    top, steps = _SIDE + 34, 60
    shares = (np.arange(steps) + 0.5) / steps
    width = _SIDE / steps
    rects = (
        tag(
            "rect",
            x=number(_MARGIN + place * width),
            y=top,
            width=number(width + 0.5),
            height=12,
            fill="#" + bytes(color.tolist()).hex(),
        )
        for place, color in enumerate(_colors(shares))
    )
    middle = float(np.sqrt(low * high))
    labels = (
        tag("text", f"{value:.0f}", x=_MARGIN + at, y=top + 28, text_anchor=anchor)
        for value, at, anchor in (
            (low, 0, "start"),
            (middle, _SIDE // 2, "middle"),
            (high, _SIDE, "end"),
        )
    )
    return joined([*rects, *labels])


def _colors(shares: Float64Array) -> np.ndarray:
    """(N,) in [0, 1] → (N, 3) uint8."""
    stops = np.linspace(0, 1, len(_STOPS))
    channels = [np.interp(shares, stops, channel) for channel in _STOPS.T]
    return np.round(np.stack(channels, axis=-1)).astype(np.uint8)
