"""pycolmap's batch pipelines on a folder of photos, each in a fresh process."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from sfm_front.errors import ConfigError
from sfm_front.evaluation.process import measure
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings, Run
from sfm_front.runtime.subprocess_env import module_command
from sfm_front.storage.colmap_models import find_models

#: How each chooses the pairs it matches.
RIVALS = {
    "exhaustive": "every pair",
    "sequential": "each photo with the next ten by name, and with those 2, 4, 8, ... further",
    "spatial": "each photo with its 50 nearest by GPS, at most 100 m away",
    "vocabtree": "each photo with its 100 nearest by visual words; the words, which COLMAP users "
    "download, are learnt on these photos before the clock starts",
}

#: Stages not counted in a method's time.
PREPARATION = ("train",)


def run_rival(name: str, photos: Path, workspace: Path, settings: BenchmarkSettings) -> Run:
    """Reconstruct the folder ``photos`` with the pipeline ``name`` into the folder ``workspace``.

    Runs on the CPU, with pycolmap's defaults for everything but ``settings``. Leaves
    ``database.db``, ``sparse/`` and ``log.txt`` in ``workspace``, which must be empty or absent.
    """
    if name not in RIVALS:
        raise ConfigError(f"no rival is called {name}; choose from {', '.join(RIVALS)}")
    workspace.mkdir(parents=True, exist_ok=True)
    task, result = workspace / "task.json", workspace / "result.json"
    task.write_text(
        json.dumps(
            {
                "pairing": name,
                "photos": str(photos),
                "workspace": str(workspace),
                **asdict(settings),
            }
        )
    )
    command = module_command(
        "sfm_front.evaluation.reconstruction.rival_process", str(task), str(result)
    )
    measured = measure(command, workspace / "log.txt")
    if measured.return_code or not result.is_file():
        return Run(
            wall_seconds=measured.wall_seconds,
            peak_memory_bytes=measured.peak_memory_bytes,
            failure=f"exit status {measured.return_code}: {measured.last_line}",
        )
    told = json.loads(result.read_text())
    seconds: dict[str, float] = told["seconds_by_stage"]
    models = tuple(find_models(workspace / "sparse"))
    return Run(
        wall_seconds=measured.wall_seconds - sum(seconds.get(stage, 0.0) for stage in PREPARATION),
        peak_memory_bytes=measured.peak_memory_bytes,
        seconds_by_stage=seconds,
        models=models,
        failure=told["failure"] if not models else None,
    )
