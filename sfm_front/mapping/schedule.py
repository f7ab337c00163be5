"""When to refine a whole model, and when the local refinement of the newest photo will do."""

from __future__ import annotations

from dataclasses import dataclass

from sfm_front.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class ScheduleOptions:
    """A model is refined as a whole each time its photos or points have grown by ``growth``.

    Geometric growth keeps the cost of global refinement, summed over a session, proportional to
    that of the last one.
    """

    growth: float = 1.25

    def __post_init__(self) -> None:
        if self.growth <= 1:
            raise ConfigError(f"growth must be above 1, got {self.growth}")


class RefinementSchedule:
    """Remembers the model's size at its last global refinement."""

    def __init__(self, options: ScheduleOptions) -> None:
        self._growth = options.growth
        self._num_images = 0
        self._num_points = 0

    def is_due(self, num_images: int, num_points: int) -> bool:
        return (
            num_images >= self._growth * self._num_images
            or num_points >= self._growth * self._num_points
        )

    def refined(self, num_images: int, num_points: int) -> None:
        """Note that the whole model has just been refined at this size."""
        self._num_images = num_images
        self._num_points = num_points
