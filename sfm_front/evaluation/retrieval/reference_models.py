"""Reference models of a pool's scenes: found in a folder, or built there with pycolmap."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.evaluation.reconstruction.rivals import run_rival
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings
from sfm_front.evaluation.retrieval.datasets.pool import Scene
from sfm_front.storage.colmap_models import find_models

#: The pipeline whose models are the reference, because it matches every pair.
PIPELINE = "exhaustive"


def with_models(
    scenes: Sequence[Scene],
    folder: Path | None,
    settings: BenchmarkSettings,
    note: Callable[[str], None],
) -> tuple[Scene, ...]:
    """Scenes with a reference model each, where one can be made.

    A scene without one is looked up in ``folder/SCENE/exhaustive``, where
    ``benchmark_reconstruction --keep`` leaves it too; if nothing is there, the model is built,
    which takes minutes to hours. If that fails, its photos only serve as distractors, and ``note``
    is told. Raises ``InputError`` if a scene has no model and ``folder`` is None.
    """
    lacking = [scene.name for scene in scenes if not scene.models]
    if lacking and folder is None:
        raise InputError(
            f"no reference model of {', '.join(lacking)}; name a folder to find or build them in: "
            "--models DIR"
        )
    return tuple(
        scene if scene.models or folder is None else _found_or_built(scene, folder, settings, note)
        for scene in scenes
    )


def _found_or_built(
    scene: Scene, folder: Path, settings: BenchmarkSettings, note: Callable[[str], None]
) -> Scene:
    home = folder / scene.name / PIPELINE
    # Built beside it, so that an interrupted run's remains are not taken for a result.
    unfinished = folder / scene.name / f"{PIPELINE}.unfinished"
    if not home.is_dir():
        note(f"{scene.name}: building its reference model by pycolmap's {PIPELINE} pipeline")
        shutil.rmtree(unfinished, ignore_errors=True)
        run_rival(PIPELINE, scene.photos, unfinished / "0", settings)
        unfinished.rename(home)
    models = tuple(find_models(home))
    if not models:
        note(f"{scene.name}: no reference model, so its photos are distractors only ({home})")
    return replace(scene, models=models)
