"""Our reconstruction as the benchmark runs it: in its own process, as a user would."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sfm_front.evaluation.process import measure
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings, Run
from sfm_front.reports.report_json import FILE, read_report
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
    summary = read_report(output) if (output / FILE).is_file() else None
    models = tuple(find_models(output / "sparse"))
    failure = None
    if measured.return_code or not models:
        failure = f"exit status {measured.return_code}: {measured.last_line}"
    return Run(
        wall_seconds=measured.wall_seconds,
        peak_memory_bytes=measured.peak_memory_bytes,
        seconds_by_stage=summary.totals.seconds_by_stage if summary else {},
        # The stages of each photo that was used, summed.
        photo_seconds=(
            tuple(sum(photo.seconds.values()) for photo in summary.used) if summary else ()
        ),
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
