"""Run our reconstruction and pycolmap's pipelines on scenes, in turn, and assess each."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np

from sfm_front.evaluation.poses import AUC_THRESHOLDS_DEG
from sfm_front.evaluation.reconstruction.ours import run_ours
from sfm_front.evaluation.reconstruction.quality import Quality, assess
from sfm_front.evaluation.reconstruction.rivals import run_rival
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.evaluation.reconstruction.sift_alone import sift_alone_seconds
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings, Run

OURS = "sfm_front"
SIFT_ALONE = "OpenCV SIFT alone"


@dataclass(frozen=True, slots=True)
class Outcome:
    """A run and the quality of its models; None for OpenCV's SIFT alone, which builds none."""

    run: Run
    quality: Quality | None


@dataclass(frozen=True, slots=True)
class Row:
    """All runs of one method on one scene, at least one."""

    scene: BenchmarkScene
    method: str
    outcomes: tuple[Outcome, ...]

    def means(self) -> dict[str, float | None]:
        """Means over the runs; None for what no run has. The quantiles of a photo's seconds are
        over the photos of all runs."""
        values: dict[str, list[float]] = {}
        for outcome in self.outcomes:
            for name, value in _numbers(outcome).items():
                values.setdefault(name, []).extend([] if value is None else [value])
        means = {name: mean(found) if found else None for name, found in values.items()}
        photos = [second for outcome in self.outcomes for second in outcome.run.photo_seconds]
        for name, percent in (("photo_seconds_median", 50), ("photo_seconds_p95", 95)):
            means[name] = float(np.percentile(photos, percent)) if photos else None
        return means

    def stage_means(self) -> dict[str, float]:
        """Seconds per stage, the mean over the runs that have it."""
        runs = [outcome.run.seconds_by_stage for outcome in self.outcomes]
        stages = dict.fromkeys(stage for run in runs for stage in run)
        return {stage: mean(run[stage] for run in runs if stage in run) for stage in stages}

    @property
    def failures(self) -> tuple[str, ...]:
        """Why runs built no model; each reason once."""
        return tuple(
            dict.fromkeys(outcome.run.failure for outcome in self.outcomes if outcome.run.failure)
        )

    def as_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON. Models are listed if their folders were kept."""
        return {
            "scene": self.scene.name,
            "photos": self.scene.num_photos,
            "method": self.method,
            "mean": {**self.means(), "seconds_by_stage": self.stage_means()},
            "runs": [
                {
                    **asdict(outcome.run),
                    "models": [str(folder) for folder in outcome.run.models if folder.exists()],
                    "quality": outcome.quality and asdict(outcome.quality),
                }
                for outcome in self.outcomes
            ],
        }


def benchmark_scene(
    scene: BenchmarkScene,
    rivals: Sequence[str],
    settings: BenchmarkSettings,
    *,
    ours: Sequence[str],
    runs: int,
    workspace: Path,
    keep: bool,
    note: Callable[[str], None],
) -> list[Row]:
    """Rows of OpenCV's SIFT alone, of ours, and of each rival.

    Every run goes through all methods, so that a machine that slows down slows all of them.
    ``ours`` starts the ``reconstruct`` command. Each run has its own folder below ``workspace``,
    removed afterwards unless ``keep``. ``note`` is called with a line about each run. Run i uses
    seed + i.
    """
    outcomes: dict[str, list[Outcome]] = {name: [] for name in (SIFT_ALONE, OURS, *rivals)}
    for number in range(runs):
        seeded = BenchmarkSettings(**{**asdict(settings), "seed": settings.seed + number})
        for method, finished in outcomes.items():
            folder = workspace / scene.name / method.replace(" ", "_") / str(number)
            if method == SIFT_ALONE:
                seconds = sift_alone_seconds(scene.photos, folder, seeded)
                outcome = Outcome(Run(wall_seconds=seconds, peak_memory_bytes=None), None)
            else:
                run = (
                    run_ours(ours, scene.photos, folder, seeded)
                    if method == OURS
                    else run_rival(method, scene.photos, folder, seeded)
                )
                outcome = Outcome(run, assess(run.models, scene))
            finished.append(outcome)
            note(f"{scene.name}, run {number + 1} of {runs}, {method}: {_told(outcome, scene)}")
            if not keep:
                shutil.rmtree(folder)
    return [Row(scene, method, tuple(finished)) for method, finished in outcomes.items()]


def _numbers(outcome: Outcome) -> dict[str, float | None]:
    run, quality = outcome.run, outcome.quality
    numbers: dict[str, float | None] = {
        "seconds": run.wall_seconds,
        "peak_memory_bytes": run.peak_memory_bytes,
    }
    if quality is None:
        return numbers
    numbers.update(
        registered=quality.registered,
        registered_in_all=quality.registered_in_all,
        models=quality.models,
        points=quality.points,
        reprojection_error_px=quality.reprojection_error_px,
        pairs_joined=quality.pairs_joined,
    )
    areas = quality.auc or (None,) * len(AUC_THRESHOLDS_DEG)
    for threshold, area in zip(AUC_THRESHOLDS_DEG, areas, strict=True):
        numbers[f"auc_{threshold:g}deg"] = area
    return numbers


def _told(outcome: Outcome, scene: BenchmarkScene) -> str:
    told = f"{outcome.run.wall_seconds:.1f} s"
    if outcome.quality is not None:
        told += f", {outcome.quality.registered} of {scene.num_photos} registered"
    return f"{told} ({outcome.run.failure})" if outcome.run.failure else told
