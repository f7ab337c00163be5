"""Which photos of a scene arrive, and in which order."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import TypeVar

from sfm_front.errors import ConfigError
from sfm_front.photos.source import shuffled

_T = TypeVar("_T")

ARRANGEMENTS = ("name", "shuffle-1", "shuffle-2", "half")
"""Those that options are tuned on: there are more, see ``arrange``."""

THINNINGS = {"whole": 1, "half": 2, "third": 3}
"""Of so many photos, in order of name, the first arrives."""


def arrange(photos: Sequence[_T], arrangement: str) -> list[_T]:
    """Photos in order of name → those that arrive, in their order.

    ``arrangement``: one of ``THINNINGS``, an order, or both: ``third-shuffle-2`` thins, then
    shuffles. An order is ``name``; ``shuffle-SEED``, as ``reconstruct --order random`` has it; or
    ``flights``: the first and the last 40 % in turn, as if two cameras took them at once, then what
    lies between. Raises ConfigError for any other.
    """
    thinning, _, order = arrangement.partition("-")
    if thinning not in THINNINGS:
        return _ordered(photos, arrangement)
    return _ordered(photos[:: THINNINGS[thinning]], order or "name")


def check_arrangements(names: Sequence[str]) -> None:
    """Raises ConfigError for one that does not exist."""
    for name in names:
        arrange((), name)


def _ordered(photos: Sequence[_T], order: str) -> list[_T]:
    if order == "name":
        return list(photos)
    if order == "flights":
        end = len(photos) * 2 // 5
        start = len(photos) - end
        in_turn = zip(photos[:end], photos[start:], strict=True)
        return [*chain.from_iterable(in_turn), *photos[end:start]]
    kind, _, seed = order.partition("-")
    if kind == "shuffle" and seed.isdecimal():
        return shuffled(photos, int(seed))
    raise ConfigError(
        f"no arrangement {order or 'given'}; there are name, flights and shuffle-SEED, "
        f"and {', '.join(THINNINGS)}, alone or before one of them as in half-shuffle-1"
    )
