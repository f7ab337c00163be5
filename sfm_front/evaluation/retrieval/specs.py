"""``KIND:FOLDER`` on the command line → datasets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sfm_front.errors import ConfigError
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings
from sfm_front.evaluation.retrieval.datasets import pool
from sfm_front.evaluation.retrieval.datasets.registry import PUBLISHED
from sfm_front.evaluation.retrieval.reference_models import with_models
from sfm_front.evaluation.retrieval.types import Dataset

POOL = "pool"
KINDS = (POOL, *PUBLISHED)


def load(
    spec: str,
    *,
    models: Path | None,
    min_shared: int,
    threads: int,
    note: Callable[[str], None],
) -> tuple[Dataset, ...]:
    """The datasets that ``spec`` names; all of them search the same photos.

    ``models``: the folder of a pool's reference models, in which missing ones are built.
    ``min_shared``: points that make two photos of a pool relevant to each other. ``note`` is called
    with lines about progress.

    Raises:
        ConfigError: no such kind.
        InputError: the folder is not that dataset, or an incomplete one.
    """
    kind, colon, folder = spec.partition(":")
    if kind not in KINDS or not colon or not folder:
        raise ConfigError(f"{spec}: name a dataset as KIND:FOLDER; kinds are {', '.join(KINDS)}")
    if kind != POOL:
        return PUBLISHED[kind](Path(folder))
    scenes = pool.find_scenes(Path(folder))
    scenes = with_models(scenes, models, BenchmarkSettings(threads=threads), note)
    return (pool.load(scenes, f"pool {Path(folder).resolve().name}", min_shared),)
