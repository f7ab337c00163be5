"""The positions of all photos of a session, each as its source gives it."""

from __future__ import annotations

from collections.abc import Callable

from sfm_front.georeference.flight_grouping import Taken, flights_of
from sfm_front.georeference.georeferencer import PhotoPosition
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
        self._taken: dict[int, Taken] = {}
        self._orientations: dict[int, int] = {}

    def take(self, image_id: int, name: str, exif: Exif) -> GeoPosition | None:
        """The position of a photo, new or restored, as a prior: None without one."""
        self._orientations[image_id] = exif.orientation
        position = self._source.position_of(name, exif)
        if position is None:
            return None
        self._taken[image_id] = Taken(name, exif.captured_at)
        self._positions[image_id] = self._options.with_sigmas(position)
        return self._positions[image_id]

    def __len__(self) -> int:
        """Photos that have one."""
        return len(self._positions)

    def checked(self) -> CheckedPositions:
        """Those that can be used, all with standard deviations, and why others cannot."""
        return check_positions(self._positions)

    def measured(self, usable: dict[int, GeoPosition]) -> dict[int, PhotoPosition]:
        """These, which ``checked`` found usable, by image id, each with its time and flight."""
        flights = flights_of(self._taken)
        return {
            image_id: PhotoPosition(
                position=position,
                horizontal_sigma_m=position.horizontal_sigma_m or self._options.horizontal_sigma_m,
                vertical_sigma_m=position.vertical_sigma_m or self._options.vertical_sigma_m,
                captured_at=self._taken[image_id].captured_at,
                flight=flights[image_id],
            )
            for image_id, position in usable.items()
        }

    @property
    def names(self) -> dict[int, str]:
        """Of the photos that have one, by image id."""
        return {image_id: taken.name for image_id, taken in self._taken.items()}

    @property
    def orientation_of(self) -> Callable[[int], int]:
        """EXIF's orientation by image id."""
        return self._orientations.__getitem__

    @property
    def num_unused_rows(self) -> int:
        """Rows of the file of positions that name no photo."""
        return self._source.num_unused
