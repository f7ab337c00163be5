"""The positions of all photos of a session, each as its source gives it."""

from __future__ import annotations

from sfm_front.photos.position_checks import CheckedPositions, check_positions
from sfm_front.photos.positions import PositionOptions, PositionSource
from sfm_front.types import Exif, GeoPosition


class PhotoPositions:
    """What is known of where photos were taken.

    The database keeps the EXIF of a photo as it was written: a resumed session takes its photos in
    again, and so has the positions that its own options and file give.
    """

    def __init__(self, options: PositionOptions) -> None:
        """Raises InputError or DependencyError if a file of positions cannot be used."""
        self._options = options
        self._source = PositionSource(options)
        self._positions: dict[int, GeoPosition] = {}

    def take(self, image_id: int, name: str, exif: Exif) -> GeoPosition | None:
        """The position of a photo, new or restored, as a prior: None without one."""
        position = self._source.position_of(name, exif)
        if position is None:
            return None
        self._positions[image_id] = self._options.with_sigmas(position)
        return self._positions[image_id]

    def checked(self) -> CheckedPositions:
        """Those that can be used, all with standard deviations, and why others cannot."""
        return check_positions(self._positions)

    @property
    def num_unused_rows(self) -> int:
        """Rows of the file of positions that name no photo."""
        return self._source.num_unused
