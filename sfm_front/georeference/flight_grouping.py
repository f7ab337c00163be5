"""Which photos were taken in one flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta

# Who lands and changes the battery takes longer.
_LONGEST_PAUSE = timedelta(minutes=5)


@dataclass(frozen=True, slots=True)
class Taken:
    """When a photo was taken, on the camera's clock, and what it is called."""

    name: str
    captured_at: datetime | None


def flights_of(photos: Mapping[int, Taken]) -> dict[int, int]:
    """Number of the flight by image id: photos of one folder without a pause of five minutes.

    Photos without a time are of the flight before them in order of name.
    """
    numbers: dict[int, int] = {}
    flight, before = 0, Taken("", None)
    for image_id, taken in sorted(photos.items(), key=lambda item: _order(item[1])):
        if numbers and _is_another(before, taken):
            flight += 1
        numbers[image_id] = flight
        before = taken
    return numbers


def _order(taken: Taken) -> tuple[tuple[str, ...], datetime, str]:
    return _folder(taken), taken.captured_at or datetime.min, taken.name


def _is_another(before: Taken, taken: Taken) -> bool:
    if _folder(before) != _folder(taken):
        return True
    if before.captured_at is None or taken.captured_at is None:
        return False
    return taken.captured_at - before.captured_at > _LONGEST_PAUSE


def _folder(taken: Taken) -> tuple[str, ...]:
    """By its parts: a path would be made three times for each photo, again and again."""
    return tuple(taken.name.split("/")[:-1])
