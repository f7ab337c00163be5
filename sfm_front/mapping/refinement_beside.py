"""The refinement of one model beside the photos that come: begun, then carried over."""

from __future__ import annotations

from dataclasses import dataclass

import pycolmap

from sfm_front.mapping.background_refinement import BackgroundAdjuster
from sfm_front.mapping.carry_over import Before
from sfm_front.mapping.mapper_options import MapperOptions

# Smaller models are refined at once: it takes no longer than to hand them on.
_SMALLEST = 8


@dataclass(frozen=True)
class Refined:
    """A copy of a model, ``before`` and as it was refined since."""

    before: Before
    copy: pycolmap.Reconstruction


class RefinementBeside:
    """What an adjuster, which all models share, does for one of them; without one, nothing."""

    def __init__(self, adjuster: BackgroundAdjuster | None) -> None:
        self.adjuster = adjuster
        self._under_way: tuple[int, Before] | None = None

    @property
    def is_under_way(self) -> bool:
        return self._under_way is not None

    def serves(self, reconstruction: pycolmap.Reconstruction) -> bool:
        """Whether a model of this size is refined here; else it has to be in its own turn."""
        if self.adjuster is None or reconstruction.num_reg_images() < _SMALLEST:
            return False
        self.adjuster.poll()
        return not self.adjuster.is_broken

    @property
    def is_free(self) -> bool:
        """Whether it can take this model now."""
        return self.adjuster is not None and self.adjuster.is_free

    def begin(self, reconstruction: pycolmap.Reconstruction, options: MapperOptions) -> None:
        """Of a copy. It must be free."""
        assert self.adjuster is not None
        before = Before.of(reconstruction)
        self._under_way = self.adjuster.submit(reconstruction, options), before

    def leave(self) -> None:
        """What is under way is not waited for."""
        self._under_way = None

    def ended(self) -> Refined | None:
        """What has been refined, once; None while it is under way, or if it failed."""
        if self.adjuster is None or self._under_way is None:
            return None
        ticket, before = self._under_way
        self.adjuster.poll()
        if self.adjuster.is_busy:
            return None
        self._under_way = None
        copy = self.adjuster.result(ticket)
        return None if copy is None else Refined(before, copy)
