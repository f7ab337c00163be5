"""How a picture of a model is drawn."""

from __future__ import annotations

from dataclasses import dataclass

from sfm_front.errors import ConfigError
from sfm_front.viewers.point_colors import COLORINGS

#: Background colour, and the grey of points if the model has no colours.
BACKGROUNDS: dict[str, tuple[tuple[float, float, float], float]] = {
    "dark": ((0.055, 0.065, 0.085), 0.75),
    "white": ((1.0, 1.0, 1.0), 0.45),
}

_LARGEST_SIDE_PX = 8192
_LARGEST_POINT_PX = 50.0


@dataclass(frozen=True, kw_only=True)
class DrawOptions:
    """Size of the picture and of its points in pixels; by default the number of points sets
    ``point_size_px``. ``background`` is a key of ``BACKGROUNDS``, whose colours are RGB in [0, 1],
    ``coloring`` of points one of ``COLORINGS``. ``frusta``: whether cameras are drawn; ``path``:
    whether a line leads from each to the next, in the order of their photos.
    """

    width: int = 1600
    height: int = 1000
    point_size_px: float | None = None
    background: str = "dark"
    coloring: str = "rgb"
    frusta: bool = True
    path: bool = False

    def __post_init__(self) -> None:
        if not all(16 <= side <= _LARGEST_SIDE_PX for side in (self.width, self.height)):
            raise ConfigError(
                f"size must be 16 to {_LARGEST_SIDE_PX} pixels a side, "
                f"got {self.width}x{self.height}"
            )
        if self.point_size_px is not None and not 0 < self.point_size_px <= _LARGEST_POINT_PX:
            raise ConfigError(
                f"point size must be above 0 and at most {_LARGEST_POINT_PX:g} pixels, "
                f"got {self.point_size_px:g}"
            )
        if self.coloring not in COLORINGS:
            raise ConfigError(
                f"points are coloured by one of {', '.join(COLORINGS)}, got {self.coloring}"
            )
        if self.background not in BACKGROUNDS:
            raise ConfigError(
                f"background must be one of {', '.join(BACKGROUNDS)}, got {self.background}"
            )
