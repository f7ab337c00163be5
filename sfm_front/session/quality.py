"""How much of each photo is looked at: presets of a session's options."""

from __future__ import annotations

from dataclasses import dataclass

from sfm_front.session.options import SessionOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class Quality:
    """Fields of ``SessionOptions`` that decide most of the time that a photo takes."""

    max_image_size: int
    max_features: int


QUALITIES = {
    "draft": Quality(max_image_size=800, max_features=2000),
    "normal": Quality(
        max_image_size=SessionOptions.max_image_size, max_features=SessionOptions.max_features
    ),
    # COLMAP's size for what it calls high.
    "high": Quality(max_image_size=2400, max_features=8000),
}
"""By name; what each costs and gives is in ``guides/accuracy.md``."""
