"""How photos are handed on with a model."""

from __future__ import annotations

from dataclasses import dataclass

from sfm_front.errors import ConfigError

_SMALLEST_SIDE_PX = 16


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """``max_size_px``: the long side that larger photos are reduced to, None for none.

    ``link``: photos that stay as they are become symbolic links instead of copies. ``threads``:
    photos that are worked on at a time.
    """

    max_size_px: int | None = None
    link: bool = False
    threads: int = 1

    def __post_init__(self) -> None:
        if self.max_size_px is not None and self.max_size_px < _SMALLEST_SIDE_PX:
            raise ConfigError(
                f"max size must be at least {_SMALLEST_SIDE_PX} pixels, got {self.max_size_px}"
            )
        if self.threads < 1:
            raise ConfigError(f"threads must be at least 1, got {self.threads}")
