"""The plane on which plans are drawn, and drawings on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sfm_front.reports.html.charts import nice_step, number
from sfm_front.reports.html.markup import Html, joined, tag
from sfm_front.reports.html.observations import Observations
from sfm_front.types import Float64Array
from sfm_front.viewers.viewpoint import upward

WIDTH = 900
_HEIGHTS = (360, 900)
_MARGIN = 0.06


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """``axes`` (3, 3), in rows: right, up in the plan, and towards who looks at it."""

    axes: Float64Array
    is_enu: bool

    def flat(self, xyz: Float64Array) -> Float64Array:
        """(N, 3) → (N, 3): right, up, towards the viewer."""
        flat: Float64Array = xyz @ self.axes.T
        return flat


def ground_of(observations: Observations, *, is_enu: bool) -> Ground:
    """East and north if the model has them; else seen from above, the photos spread sideways
    and, all in all, looking up in the plan."""
    if is_enu:
        return Ground(np.eye(3), True)
    up = upward(observations.world_from_cam, observations.centres)
    level = observations.centres - observations.centres.mean(axis=0)
    level = level - np.outer(level @ up, up)
    right = np.linalg.svd(level)[2][0]
    right = right - (right @ up) * up
    if np.linalg.norm(right) < 1e-6:  # All photos in one place.
        right = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    right = right / np.linalg.norm(right)
    if np.cross(up, right) @ observations.world_from_cam[:, :, 2].mean(axis=0) < 0:
        right = -right
    return Ground(np.stack([right, np.cross(up, right), up]), False)


def facing_plane(observations: Observations) -> Ground:
    """The plane in which the points spread most, seen from the side of the photos."""
    centred = observations.xyz - np.median(observations.xyz, axis=0)
    near = np.linalg.norm(centred, axis=1) <= np.percentile(np.linalg.norm(centred, axis=1), 90)
    normal = np.linalg.svd(centred[near], full_matrices=False)[2][2]
    middle = np.median(observations.xyz, axis=0)
    if (observations.centres.mean(axis=0) - middle) @ normal < 0:
        normal = -normal
    # What is up for the cameras is up in the plan, but where they look down on it.
    up = upward(observations.world_from_cam, observations.centres)
    if abs(up @ normal) > 0.8:
        up = -observations.world_from_cam[:, :, 1].mean(axis=0)
    up = up - (up @ normal) * normal
    if np.linalg.norm(up) < 1e-3:
        up = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    up = up / np.linalg.norm(up)
    return Ground(np.stack([np.cross(up, normal), up, normal]), False)


@dataclass(frozen=True, slots=True)
class Sheet:
    """A plan of ``width`` by ``height`` pixels: its left top corner is at ``left``, ``top`` of the
    ground, a pixel is ``unit`` of it."""

    left: float
    top: float
    unit: float
    width: int
    height: int

    def pixels(self, flat: Float64Array) -> Float64Array:
        """(N, 2 or 3) on the ground → (N, 2), y down."""
        pixels: Float64Array = np.column_stack(
            [(flat[:, 0] - self.left) / self.unit, (self.top - flat[:, 1]) / self.unit]
        )
        return pixels


def sheet_around(flat: Float64Array) -> Sheet:
    """On which all of ``flat`` (N, 2 or 3) finds place."""
    low, high = flat[:, :2].min(axis=0), flat[:, :2].max(axis=0)
    extent = np.maximum(high - low, 1e-6 + 0.02 * float((high - low).max()))
    low, extent = (low + high) / 2 - extent / 2, extent * (1 + 2 * _MARGIN)
    low = low - extent * _MARGIN / (1 + 2 * _MARGIN)
    height = int(np.clip(WIDTH * extent[1] / extent[0], *_HEIGHTS))
    unit = float(max(extent[0] / WIDTH, extent[1] / height))
    middle = low + extent / 2
    return Sheet(
        left=float(middle[0] - unit * WIDTH / 2),
        top=float(middle[1] + unit * height / 2),
        unit=unit,
        width=WIDTH,
        height=height,
    )


def north_arrow(sheet: Sheet) -> Html:
    """North is up."""
    x = sheet.width - 34
    return tag(
        "g",
        tag("path", d=f"M{x} 16 l9 30 l-9 -7 l-9 7 z"),
        tag("text", "N", x=x, y=62, text_anchor="middle"),
        class_="north",
    )


def scale_bar(sheet: Sheet) -> Html:
    """About a sixth of the plan, in metres."""
    metres = nice_step(sheet.unit * sheet.width, 6)
    length = metres / sheet.unit
    y = sheet.height - 20
    label = f"{metres / 1000:g} km" if metres >= 1000 else f"{metres:g} m"
    return tag(
        "g",
        tag("path", d=f"M20 {y - 6} v6 h{number(length)} v-6"),
        tag("text", label, x=number(20 + length / 2), y=y - 8, text_anchor="middle"),
        class_="scale",
    )


def image_on(sheet: Sheet, address: str, **attributes: object) -> Html:
    """A picture that fills the sheet."""
    size = {"width": sheet.width, "height": sheet.height}
    return tag("image", href=address, x=0, y=0, **size, **attributes)


def marks(sheet: Sheet, ground: Ground) -> Html | None:
    """North arrow and scale bar, where metres and north are known."""
    return joined([north_arrow(sheet), scale_bar(sheet)]) if ground.is_enu else None
