"""When to refine a whole model, and when the local refinement of the newest photo will do."""

from __future__ import annotations

from dataclasses import dataclass

from sfm_front.errors import ConfigError

# Photos from which a model is refined seldom, and its last adjustments go on for long. A long
# flight unbends slowly; on small models patience only takes longer.
LARGE = 100
_PHOTOS_PER_BATCH = 250


def local_refinement_batch(num_images: int) -> int:
    """How many new photos of a model of this size share a local refinement."""
    return 1 + num_images // _PHOTOS_PER_BATCH


@dataclass(frozen=True, kw_only=True)
class ScheduleOptions:
    """A model is refined as a whole each time its photos or points have grown by ``growth``; one
    of ``large_from`` photos or more by ``large_growth``.

    Geometric growth keeps the cost of global refinement, summed over a session, proportional to
    that of the last one. That cost grows faster than the model, and a large model is not bent by
    what a few photos add.
    """

    growth: float = 1.25
    large_growth: float = 1.6
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

    def is_due(self, num_images: int, num_points: int) -> bool:
        late = self._num_images >= self._options.large_from
        growth = self._options.large_growth if late else self._options.growth
        return num_images >= growth * self._num_images or num_points >= growth * self._num_points

    def refined(self, num_images: int, num_points: int) -> None:
        """Note that the whole model has just been refined at this size."""
        self._num_images = num_images
        self._num_points = num_points
