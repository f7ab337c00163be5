"""Which photos of a scene arrive, and in which order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from sfm_front.errors import ConfigError
from sfm_front.photos.source import shuffled

_T = TypeVar("_T")


# Shuffles are those of ``reconstruct --order random --seed N``.
_ARRANGEMENTS: dict[str, Callable[[Sequence[_T]], list[_T]]] = {
    "name": list,
    "shuffle-1": lambda photos: shuffled(photos, 1),
    "shuffle-2": lambda photos: shuffled(photos, 2),
    "half": lambda photos: list(photos[::2]),
}

ARRANGEMENTS = tuple(_ARRANGEMENTS)
"""In order of name, shuffled with seeds 1 and 2, and every second photo in order of name."""


def arrange(photos: Sequence[_T], arrangement: str) -> list[_T]:
    """Photos in order of name → those that arrive, in their order."""
    return _ARRANGEMENTS[arrangement](photos)


def check_arrangements(names: Sequence[str]) -> None:
    """Raises ConfigError for one that does not exist."""
    unknown = [name for name in names if name not in ARRANGEMENTS]
    if unknown or not names:
        raise ConfigError(
            f"no arrangement {', '.join(unknown) or 'given'}; there are {', '.join(ARRANGEMENTS)}"
        )
