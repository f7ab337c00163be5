"""The best known position of each photo: from its EXIF, from a file, or none."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from sfm_front.errors import ConfigError
from sfm_front.photos.position_file import read_position_file
from sfm_front.types import Exif, GeoPosition

EXIF, OFF = "exif", "off"


@dataclass(frozen=True, kw_only=True)
class PositionOptions:
    """Where positions come from, and how far they are trusted."""

    # exif: what cameras wrote, XMP included. off: nowhere. Else a file, CSV or ODM's geo.txt: it
    # counts for the photos that it names, EXIF for the others.
    source: str = EXIF
    # Standard deviation of east and of north each, where nothing else says it.
    horizontal_sigma_m: float = 5.0
    # Standard deviation of the altitude, where nothing else says it.
    vertical_sigma_m: float = 10.0

    def __post_init__(self) -> None:
        if not self.source:
            raise ConfigError("source of positions must be exif, off or a file, got nothing")
        for name in ("horizontal_sigma_m", "vertical_sigma_m"):
            value = getattr(self, name)
            if not 0 < value < float("inf"):
                raise ConfigError(f"{name} must be a number of metres above 0, got {value}")

    def with_sigmas(self, position: GeoPosition) -> GeoPosition:
        """The position with a standard deviation of each kind: its own, else that of here."""
        return replace(
            position,
            horizontal_sigma_m=position.horizontal_sigma_m or self.horizontal_sigma_m,
            vertical_sigma_m=position.vertical_sigma_m or self.vertical_sigma_m,
        )


class PositionSource:
    """Gives photos their positions, as they arrive.

    A row of a file is for the photo of its name, or one of both names is the end of the other:
    ``flight/a.jpg`` takes the row of ``a.jpg``, and ``a.jpg`` that of ``/home/me/flight/a.jpg``, if
    there is one only. Upper and lower case are the same. A row is for one photo: of two in
    different folders that would take it, the first one has it.
    """

    def __init__(self, options: PositionOptions) -> None:
        """Raises InputError or DependencyError as ``read_position_file`` does."""
        self._is_off = options.source == OFF
        rows: Mapping[str, GeoPosition] = {}
        if options.source not in (EXIF, OFF):
            rows = read_position_file(Path(options.source))
        self._rows = {name.casefold(): position for name, position in rows.items()}
        rows_of = Counter(ending for row in self._rows for ending in _endings(row))
        self._row_by_ending = {
            ending: row for row in self._rows for ending in _endings(row) if rows_of[ending] == 1
        }
        self._taken_by: dict[str, str] = {}

    def position_of(self, name: str, exif: Exif) -> GeoPosition | None:
        """The position of the photo ``name``; the same each time it is asked for."""
        if self._is_off:
            return None
        row = self._row_of(name)
        return exif.position if row is None else self._rows[row]

    @property
    def num_rows(self) -> int:
        """Rows of the file; 0 without one."""
        return len(self._rows)

    @property
    def num_unused(self) -> int:
        """Rows of the file that no photo has taken."""
        return len(self._rows) - len(self._taken_by)

    def _row_of(self, name: str) -> str | None:
        key = name.casefold()
        rows = [ending for ending in _endings(key) if ending in self._rows]
        if not rows and key in self._row_by_ending:
            rows = [self._row_by_ending[key]]
        return next((row for row in rows if self._taken_by.setdefault(row, name) == name), None)


def _endings(name: str) -> Iterator[str]:
    """``a/b/c.jpg`` → ``a/b/c.jpg``, ``b/c.jpg``, ``c.jpg``."""
    while name:
        yield name
        _, _, name = name.partition("/")
