"""Charts as SVG: histograms, areas over time, the scales along them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sfm_front.reports.html.markup import Html, joined, tag
from sfm_front.types import Float64Array

WIDTH, HEIGHT = 560, 260
_LEFT, _RIGHT, _TOP, _BOTTOM = 52, 10, 14, 42


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A layer of an area chart: its label and a value for each column."""

    label: str
    values: Float64Array


def svg(width: float, height: float, *children: object, label: str, **attributes: object) -> Html:
    """A drawing that scales with the page; ``label`` is what it is called where it is read out."""
    return tag(
        "svg",
        *children,
        viewBox=f"0 0 {number(width)} {number(height)}",
        role="img",
        aria_label=label,
        **attributes,
    )


def number(value: float) -> str:
    """Short: two decimals at most."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


def quantity(value: float) -> str:
    """As axes have it: 1500 → 1.5k."""
    return f"{value / 1000:g}k" if abs(value) >= 1000 else f"{value:g}"


def nice_step(extent: float, count: int) -> float:
    """1, 2 or 5 times a power of ten: about ``count`` of them make ``extent``."""
    rough = max(extent, 1e-12) / count
    power = 10.0 ** math.floor(math.log10(rough))
    return next(power * factor for factor in (1, 2, 5, 10) if power * factor >= rough * 0.999)


def nice_ticks(high: float, count: int = 5) -> list[float]:
    """From 0 to ``high``."""
    step = nice_step(high, count)
    return [step * place for place in range(int(high / step + 1e-6) + 1)]


def histogram(
    counts: Sequence[float],
    edges: Sequence[float],
    *,
    title: str,
    xlabel: str,
    ticks: Sequence[tuple[float, str]],
    mark: tuple[float, str] | None = None,
) -> Html:
    """Bars of ``counts`` between ``edges``, one more of them; ``ticks`` and ``mark``, a line across
    the bars, are places along the axis with their labels."""
    plot = _Plot(edges[0], edges[-1], max(*counts, 1))
    bars = joined(
        tag(
            "rect",
            tag("title", f"{count:g}"),
            x=number(plot.x(low) + 0.6),
            y=number(plot.y(count)),
            width=number(max(plot.x(high) - plot.x(low) - 1.2, 0.5)),
            height=number(plot.y(0) - plot.y(count)),
            class_="bar",
        )
        for count, low, high in zip(counts, edges, edges[1:], strict=False)
    )
    marked = None
    if mark is not None:
        x, towards = plot.x(mark[0]), "end" if plot.x(mark[0]) > WIDTH * 0.6 else "start"
        marked = joined(
            [
                _line(x, _TOP, x, plot.y(0), "mark"),
                _text(x + (6 if towards == "start" else -6), _TOP + 10, mark[1], towards),
            ]
        )
    return svg(WIDTH, HEIGHT, plot.grid(), bars, marked, plot.axis(ticks, xlabel), label=title)


def stacked_areas(
    layers: Sequence[Series],
    *,
    title: str,
    xlabel: str,
    ylabel: str,
    ticks: Sequence[tuple[float, str]],
    column_title: Callable[[int], str],
) -> Html:
    """Layers one upon the other, the first at the bottom; ``column_title`` is shown on hovering."""
    columns = len(layers[0].values)
    top = np.cumsum([layer.values for layer in layers], axis=0)
    width = 2 * WIDTH
    plot = _Plot(0, columns, float(top.max()) or 1.0, width)
    # Steps, for each column is a photo: a slope between two would say what neither took.
    xs = np.repeat(np.arange(columns + 1), 2)[1:-1]
    areas = []
    for place, upper in enumerate(top):
        lower = top[place - 1] if place else np.zeros(columns)
        there = [(x, y) for x, y in zip(xs, np.repeat(upper, 2), strict=True)]
        back = [(x, y) for x, y in zip(xs[::-1], np.repeat(lower, 2)[::-1], strict=True)]
        points = " ".join(f"{number(plot.x(x))},{number(plot.y(y))}" for x, y in there + back)
        areas.append(tag("polygon", points=points, class_=f"layer-{place}"))
    hover = joined(
        tag(
            "rect",
            tag("title", column_title(column)),
            x=number(plot.x(column)),
            y=_TOP,
            width=number(plot.x(column + 1) - plot.x(column)),
            height=number(plot.y(0) - _TOP),
            class_="hover",
        )
        for column in range(columns)
    )
    return svg(
        width,
        HEIGHT,
        plot.grid(),
        joined(areas),
        plot.axis(ticks, xlabel),
        _text(_LEFT, _TOP - 3, ylabel, "start"),
        hover,
        label=title,
    )


def legend(entries: Sequence[tuple[str, str]]) -> Html:
    """Swatches of these classes with their labels."""
    return tag(
        "ul",
        joined(tag("li", tag("i", class_=f"swatch {name}"), label) for name, label in entries),
        class_="legend",
    )


@dataclass(frozen=True, slots=True)
class _Plot:
    """From values to the drawing: ``low`` to ``high`` along, 0 to ``top`` up."""

    low: float
    high: float
    top: float
    width: float = WIDTH

    def x(self, value: float) -> float:
        share = (value - self.low) / ((self.high - self.low) or 1)
        return _LEFT + float(share) * (self.width - _LEFT - _RIGHT)

    def y(self, value: float) -> float:
        return HEIGHT - _BOTTOM - float(value / self.top) * (HEIGHT - _BOTTOM - _TOP)

    def grid(self) -> Html:
        return joined(
            joined(
                [
                    _line(_LEFT, self.y(tick), self.width - _RIGHT, self.y(tick), "grid"),
                    _text(_LEFT - 6, self.y(tick) + 4, quantity(tick), "end"),
                ]
            )
            for tick in nice_ticks(self.top, 4)
        )

    def axis(self, ticks: Sequence[tuple[float, str]], label: str) -> Html:
        middle = (_LEFT + self.width - _RIGHT) / 2
        return joined(
            [
                _line(_LEFT, self.y(0), self.width - _RIGHT, self.y(0), "axis"),
                *(_text(self.x(at), self.y(0) + 16, text, "middle") for at, text in ticks),
                _text(middle, HEIGHT - 6, label, "middle", "label"),
            ]
        )


def _line(x1: float, y1: float, x2: float, y2: float, kind: str) -> Html:
    return tag("line", x1=number(x1), y1=number(y1), x2=number(x2), y2=number(y2), class_=kind)


def _text(x: float, y: float, text: str, anchor: str, kind: str | None = None) -> Html:
    return tag("text", text, x=number(x), y=number(y), text_anchor=anchor, class_=kind)
