"""A plan of the photos: which are placed, and how far from where positions have them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sfm_front.reports.html.charts import legend, nice_step, number, svg
from sfm_front.reports.html.ground import Sheet, ground_of, image_on, marks, sheet_around
from sfm_front.reports.html.markup import Html, figure, joined, picture, tag
from sfm_front.reports.html.material import Material
from sfm_front.reports.html.observations import Observations
from sfm_front.reports.html.splatting import evenly, fitting_radius_px, reduced, splat
from sfm_front.types import Float64Array

# Points beyond these percentiles do not widen the plan.
_MIDDLE = (4.0, 96.0)
# Of the plan's width: how long the longest arrows are, of nine in ten; less where photos are dense.
_ARROW_SHARE = 0.04
_ARROW_SHARE_OF_GAP = 0.6
_DOT_PX = (3.0, 6.0)


def plan(material: Material) -> Html | None:
    """None without a model."""
    observations = material.observations
    if observations is None:
        return None
    ground = ground_of(observations, is_enu=material.frame is not None)
    placed = dict(
        zip(observations.image_ids.tolist(), ground.flat(observations.centres), strict=True)
    )
    measured = material.measured_enu()
    missing = {i: enu for i, enu in measured.items() if i not in placed and i in material.names}
    points = ground.flat(observations.xyz)
    sheet = sheet_around(_framed([*placed.values()], [*missing.values()], points))
    arrows, arrow_words = _arrows(sheet, placed, measured)
    dot = float(np.clip(60 / np.sqrt(len(placed)), *_DOT_PX))
    drawing = svg(
        sheet.width,
        sheet.height,
        image_on(sheet, _cloud(sheet, observations, points), class_="cloud"),
        arrows,
        _dots(material, sheet, missing, dot, "missing"),
        _dots(material, sheet, placed, dot, "placed"),
        marks(sheet, ground),
        label="plan of the photos",
    )
    entries = [("placed", f"{len(placed)} photos in the model")]
    if missing:
        entries.append(("missing", f"{len(missing)} not in it, where their positions have them"))
    where = (
        "Seen from above, north is up."
        if ground.is_enu
        else "Seen from above; without positions, neither north nor metres are known."
    )
    return figure(joined([drawing, legend(entries)]), f"{where}{arrow_words}", class_="plan")


def _framed(
    placed: list[Float64Array], missing: list[Float64Array], points: Float64Array
) -> Float64Array:
    """(N, 2) what must be on the plan."""
    framed = [np.array(placed)[:, :2], np.array(missing).reshape(-1, 3)[:, :2]]
    if len(points):
        framed.append(np.percentile(points[:, :2], _MIDDLE, axis=0))
    return np.concatenate(framed)


def _cloud(sheet: Sheet, observations: Observations, points: Float64Array) -> str:
    """The points from above, the highest on top."""
    size = sheet.width, sheet.height
    kept = evenly(len(points))
    pixels, depths = sheet.pixels(points[kept]), -points[kept, 2]
    colors = observations.colors[kept] / 255.0
    if not colors.any():
        colors = np.full(colors.shape, 0.55)
    return picture(
        reduced(splat(pixels, depths, colors, size, fitting_radius_px(len(pixels), size)))
    )


def _dots(
    material: Material, sheet: Sheet, at: dict[int, Float64Array], radius: float, kind: str
) -> Html:
    pixels = sheet.pixels(np.array([*at.values()]).reshape(-1, 3))
    return joined(
        tag(
            "circle",
            tag("title", material.names.get(image_id, image_id)),
            cx=number(x),
            cy=number(y),
            r=number(radius),
            class_=kind,
        )
        for image_id, (x, y) in zip(at, pixels.tolist(), strict=True)
    )


def _arrows(
    sheet: Sheet, placed: dict[int, Float64Array], measured: dict[int, Float64Array]
) -> tuple[Html | None, str]:
    """From each photo to where its position has it, longer than they are, and by how much."""
    both = [image_id for image_id in placed if image_id in measured]
    if not both:
        return None, ""
    starts = np.array([placed[image_id][:2] for image_id in both])
    residuals = np.array([measured[image_id][:2] for image_id in both]) - starts
    usual = float(np.percentile(np.linalg.norm(residuals, axis=1), 90))
    share = min(_ARROW_SHARE, _ARROW_SHARE_OF_GAP / np.sqrt(len(both)))
    wanted = share * sheet.width * sheet.unit / max(usual, 1e-9)
    times = max(nice_step(wanted, 1) / (2 if nice_step(wanted, 1) > 1.5 * wanted else 1), 1.0)
    # One of a receiver that was wrong by a kilometre would cross the whole plan.
    lengths = np.linalg.norm(residuals, axis=1, keepdims=True) * times
    longest = 5 * share * sheet.width * sheet.unit
    shown = residuals * times * np.minimum(1, longest / np.maximum(lengths, 1e-12))
    lines = zip(sheet.pixels(starts).tolist(), sheet.pixels(starts + shown).tolist(), strict=True)
    enlarged = f", {times:g} times as long as they are" if times > 1 else ""
    words = f" Arrows point to the measured positions{enlarged}."
    return tag("g", _paths(lines), class_="arrows"), words


def _paths(lines: Iterable[tuple[list[float], list[float]]]) -> Html:
    return joined(arrow(*start, *end) for start, end in lines)


def arrow(x1: float, y1: float, x2: float, y2: float) -> Html:
    """A line with a head; without one where it would be longer than the line."""
    length = float(np.hypot(x2 - x1, y2 - y1))
    path = f"M{number(x1)} {number(y1)}L{number(x2)} {number(y2)}"
    if length > 4:
        along = np.array([x2 - x1, y2 - y1]) / length
        across = np.array([-along[1], along[0]])
        for side in (1, -1):
            x, y = np.array([x2, y2]) - 4 * along + side * 2.4 * across
            path += f"M{number(x2)} {number(y2)}L{number(x)} {number(y)}"
    return tag("path", d=path)
