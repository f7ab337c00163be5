"""The ground under models in metres: a grid, the way north, and a bar of a known length."""

from __future__ import annotations

import numpy as np
import viser

from sfm_front.live_page.scenery import Ground
from sfm_front.reports.html.charts import nice_step, number
from sfm_front.types import Float64Array

# Cells across the ground, and what the grid shows beside it, as a share of it.
_CELLS = 10
_MARGIN = 0.12
_BAR_SHARE = 0.25
_INK = (150, 156, 168)


class GroundDrawing:
    """Nodes that are there once a model is in metres."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._shown: tuple[float, ...] | None = None
        self._nodes: list[viser.SceneNodeHandle] = []

    def show(self, ground: Ground | None, eye: Float64Array) -> None:
        """Draw it anew if it has changed by much; ``eye`` (3,): where most look from."""
        state = None if ground is None else (*_state(ground), *_side(ground, eye))
        if state == self._shown:
            return
        for node in self._nodes:
            node.remove()
        self._nodes = [] if ground is None else self._draw(ground, _side(ground, eye))
        self._shown = state

    def _draw(self, ground: Ground, side: tuple[float, float]) -> list[viser.SceneNodeHandle]:
        scene = self._scene
        sides = ground.high[:2] - ground.low[:2]
        extent = float(sides.max())
        step_m = nice_step(extent / ground.metre, _CELLS)
        step = step_m * ground.metre
        margin = _MARGIN * extent
        # Whole cells on all sides.
        width, height = (np.ceil((sides + 2 * margin) / step) * step).tolist()
        middle = (ground.low + ground.high) / 2
        floor = float(ground.low[2])
        bar_m = nice_step(_BAR_SHARE * extent / ground.metre, 1)
        bar, bar_middle = _bar(middle[:2], sides / 2 + margin / 4, side, bar_m * ground.metre)
        # North: an arrow at the middle of the northern edge.
        foot = np.array([middle[0], middle[1] + height / 2])
        arrow = margin * np.array(
            [[[0, 0], [0, 1.0]], [[0, 1.0], [-0.3, 0.6]], [[0, 1.0], [0.3, 0.6]]]
        )
        flat = np.concatenate([bar, foot + arrow])
        segments = np.concatenate([flat, np.full((*flat.shape[:2], 1), floor)], axis=2)
        return [
            scene.add_grid(
                "/ground/grid",
                width,
                height,
                cell_size=step,
                section_size=5 * step,
                cell_color=_INK,
                section_color=_INK,
                cell_thickness=0.6,
                section_thickness=0.6,
                shadow_opacity=0.0,
                position=(middle[0], middle[1], floor),
            ),
            scene.add_line_segments(
                "/ground/marks",
                segments.astype(np.float32),
                _INK,
                thickness=3.0,
                thickness_units="screen",
            ),
            scene.add_label(
                "/ground/length",
                length(bar_m),
                position=(*bar_middle, floor),
                anchor="top-center",
            ),
            scene.add_label(
                "/ground/north",
                "N",
                position=(foot[0], foot[1] + margin, floor),
                anchor="bottom-center",
            ),
        ]


def _side(ground: Ground, eye: Float64Array) -> tuple[float, float]:
    """East and north: the side of the ground that is nearest to the eye."""
    east, north = (eye - (ground.low + ground.high) / 2)[:2] / (ground.high - ground.low)[:2]
    return (0.0, float(np.sign(north))) if abs(north) > abs(east) else (float(np.sign(east)), 0.0)


def _bar(
    middle: Float64Array, reach: Float64Array, side: tuple[float, float], bar: float
) -> tuple[Float64Array, Float64Array]:
    """(3, 2, 2): a bar with its ends along a side of the ground; (2,) its middle."""
    at = middle + reach * side
    along = np.array([side[1], -side[0]])
    across = np.array(side)
    one, other = at - bar / 2 * along, at + bar / 2 * along
    end = 0.05 * bar * across
    return np.array([[one, other], [one - end, one + end], [other - end, other + end]]), at


def length(metres: float) -> str:
    """In words: 20 m, 1.5 km, 50 cm."""
    if metres >= 1000:
        return f"{number(metres / 1000)} km"
    return f"{number(metres)} m" if metres >= 1 else f"{number(100 * metres)} cm"


def _state(ground: Ground) -> tuple[float, ...]:
    """Equal for grounds that look alike."""
    extent = float(np.max(ground.high - ground.low)) or 1.0
    return (
        *np.round(np.concatenate([ground.low, ground.high]) / (0.05 * extent)).tolist(),
        round(float(np.log(ground.metre)) / 0.02),
    )
