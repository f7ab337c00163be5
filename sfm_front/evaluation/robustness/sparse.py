"""Ours beside COLMAP's exhaustive pipeline on a scene from which photos were left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from sfm_front.evaluation.reconstruction.quality import Quality, assess
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene, limited_to
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings
from sfm_front.evaluation.robustness.kept_rival import rival_models
from sfm_front.evaluation.tuning.arrangements import arrange
from sfm_front.evaluation.tuning.trials import Described, Trial, run_trial
from sfm_front.photos.source import list_photos
from sfm_front.session.options import SessionOptions

ORDERS = ("name", "shuffle-1", "shuffle-2")
"""In which ours takes the photos that are left; the rival gets them all at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One thinning of a scene, one of ``arrangements.THINNINGS``. ``ours``: by order."""

    scene: str
    thinning: str
    photos: int
    rival: Quality
    ours: dict[str, Trial]

    def misses(self) -> list[str]:
        """The orders in which our largest model has fewer photos than the rival's."""
        return [
            order
            for order, trial in self.ours.items()
            if trial.quality.registered < self.rival.registered
        ]

    def as_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {**asdict(self), "misses": self.misses()}


def compare(
    scene: BenchmarkScene,
    described: Sequence[Described],
    thinning: str,
    rivals: Path,
    settings: BenchmarkSettings,
    options: SessionOptions,
    count: Callable[[], None],
) -> Comparison:
    """Thin the scene and reconstruct it in each of ``ORDERS``.

    ``described``: all photos, in order of name. ``rivals``: a folder that keeps what the rival
    builds with ``settings``. ``count`` is called for each photo that ours takes in.
    """
    photos = arrange(list_photos(scene.photos), thinning)
    models = rival_models(photos, rivals / scene.name / thinning, settings)
    return Comparison(
        scene=scene.name,
        thinning=thinning,
        photos=len(photos),
        rival=assess(models, limited_to(scene, [photo.name for photo in photos])),
        ours={
            order: run_trial(scene, described, f"{thinning}-{order}", options, count)
            for order in ORDERS
        },
    )
