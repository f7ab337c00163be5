"""When to refine a whole model, and when local refinement suffices."""

from __future__ import annotations

from dataclasses import dataclass

from sfm_front.errors import ConfigError

# Photos from which a model is refined globally less often, and its last adjustments converge
# longer: long flights unbend slowly, small models gain nothing (TUNING: large-growth).
LARGE = 100


@dataclass(frozen=True, kw_only=True)
class ScheduleOptions:
    """A model is refined globally each time its photos or points have grown by a factor.

    Geometric growth keeps the cost of global refinement, summed over a session, proportional to
    that of the last one. That cost grows faster than the model, and a large model is not bent by
    what a few photos add.
    """

    growth: float = 1.25
    # The factor from ``large_from`` photos on (TUNING: large-growth).
    large_growth: float = 1.6
    # Photos from which a model counts as large.
    large_from: int = LARGE

    def __post_init__(self) -> None:
        for name in ("growth", "large_growth"):
            value = getattr(self, name)
            if value <= 1:
                raise ConfigError(f"{name} must be above 1, got {value}")


class RefinementSchedule:
    """Remembers the model's size at its last global refinement."""

    def __init__(self, options: ScheduleOptions) -> None:
        self._options = options
        self._num_images = 0
        self._num_points = 0

    @property
    def last(self) -> tuple[int, int]:
        """Photos and points of the model at its last global refinement."""
        return self._num_images, self._num_points

    def is_due(self, num_images: int, num_points: int) -> bool:
        late = self._num_images >= self._options.large_from
        growth = self._options.large_growth if late else self._options.growth
        return num_images >= growth * self._num_images or num_points >= growth * self._num_points

    def refined(self, num_images: int, num_points: int) -> None:
        """Note that the whole model has just been refined at this size."""
        self._num_images = num_images
        self._num_points = num_points
