"""Colours that mean something, the same in the scene and beside it; RGB of 0 to 255."""

from __future__ import annotations

import numpy as np

from sfm_front.reports.lights import Level
from sfm_front.types import Uint8Array

Color = tuple[int, int, int]

#: Cameras of the largest model, of the second, and so on.
MODELS: tuple[Color, ...] = (
    (59, 130, 246),
    (168, 85, 247),
    (20, 184, 166),
    (236, 72, 153),
    (132, 204, 22),
)
NEWEST: Color = (250, 204, 21)
WEAK: Color = (249, 115, 22)
WAITING: Color = (239, 68, 68)
LINK: Color = (34, 197, 94)
FAINT: Color = (112, 118, 130)
OF_LEVEL: dict[Level, Color] = {Level.GOOD: LINK, Level.FAIR: NEWEST, Level.BAD: WAITING}
"""Of verdicts, which are one of these."""


def of_model(number: int) -> Color:
    """That of a model, by its place among them."""
    return MODELS[number % len(MODELS)]


def css(color: Color) -> str:
    """As style sheets have it."""
    return f"rgb({color[0]},{color[1]},{color[2]})"


def linear(colors: Uint8Array | Color) -> Uint8Array:
    """(..., 3) as viser's lines need them: it takes their colours for linear light."""
    share = np.asarray(colors, np.float64) / 255
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.rint(255 * light), np.uint8)
