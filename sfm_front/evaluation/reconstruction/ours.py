"""Our reconstruction as the benchmark runs it: in its own process, as a user would."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sfm_front.evaluation.process import measure
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings, Run
from sfm_front.storage.colmap_models import find_models


def run_ours(
    command: Sequence[str], photos: Path, workspace: Path, settings: BenchmarkSettings
) -> Run:
    """Reconstruct the folder ``photos`` into ``workspace/output``, with ``log.txt`` beside it.

    ``command`` starts the ``reconstruct`` command; its arguments are appended.
    """
    workspace.mkdir(parents=True, exist_ok=True)
    output = workspace / "output"
    measured = measure(
        [*command, str(photos), "--output", str(output), *_arguments(settings)],
        workspace / "log.txt",
    )
    report_file = output / "report.json"
    report = json.loads(report_file.read_text("utf-8")) if report_file.is_file() else {}
    models = tuple(find_models(output / "sparse"))
    failure = None
    if measured.return_code or not models:
        failure = f"exit status {measured.return_code}: {measured.last_line}"
    return Run(
        wall_seconds=measured.wall_seconds,
        peak_memory_bytes=measured.peak_memory_bytes,
        seconds_by_stage=report.get("totals", {}).get("seconds_by_stage", {}),
        photo_seconds=_photo_seconds(report),
        models=models,
        failure=failure,
    )


def _arguments(settings: BenchmarkSettings) -> list[str]:
    given = {
        "--max-image-size": settings.max_image_size_px,
        "--max-features": settings.max_features,
        "--threads": settings.threads,
        "--camera-mode": settings.camera_mode,
        "--order": settings.order,
        "--seed": settings.seed,
    }
    return [text for option, value in given.items() for text in (option, str(value))]


def _photo_seconds(report: dict[str, Any]) -> tuple[float, ...]:
    """Seconds of each photo that was not skipped, summed over its stages."""
    return tuple(
        sum(photo["seconds"].values())
        for photo in report.get("photos", [])
        if photo.get("skipped") is None
    )
