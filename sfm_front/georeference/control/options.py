"""Where control points come from, and how exact they and their marks are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sfm_front.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class ControlOptions:
    """The file of control points, and how far it is believed."""

    # ODM's gcp_list.txt. None: there are no control points.
    file: Path | None = None
    # Width and height in pixels of the photos in which the marks were made, where the photos have
    # been reduced or enlarged since.
    marked_size: tuple[int, ...] | None = None
    # Standard deviations where the file does not say: of east and of north each, and of heights.
    horizontal_sigma_m: float = 0.02
    vertical_sigma_m: float = 0.03
    # Reprojection error of a mark in another place than the others of its point: COLMAP's limit
    # for keypoints, in pixels of the photo.
    max_mark_error_px: float = 4.0
    # Residual of a point that was marked or surveyed wrongly, in standard deviations.
    max_sigmas: float = 4.0
    # By how much heights may be off that the file does not give, where positions of the photos
    # have levelled the model.
    unknown_height_sigma_m: float = 10.0

    def __post_init__(self) -> None:
        size = self.marked_size
        if size is not None and (len(size) != 2 or min(size) < 1):
            raise ConfigError(
                f"marked_size must be width and height in pixels, got {','.join(map(str, size))}"
            )
        for name in (
            "horizontal_sigma_m",
            "vertical_sigma_m",
            "max_mark_error_px",
            "max_sigmas",
            "unknown_height_sigma_m",
        ):
            value = getattr(self, name)
            if not 0 < value < float("inf"):
                raise ConfigError(f"{name} must be a number above 0, got {value}")
