"""``retrieval.jsonl`` while photos arrive, ``report.json`` at the end."""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from sfm_front.runtime.closeable import Closeable
from sfm_front.storage.json_files import write_json
from sfm_front.types import PREFETCHED_STAGES, ModelSummary, RejectedPair, StepReport


class Report(Closeable):
    """Collects what became of each photo and writes it down."""

    def __init__(self, output: Path) -> None:
        self._output = output
        self._started = time.perf_counter()
        self._steps: list[StepReport] = []
        self._names: dict[int, str] = {}
        self._retrieval = (output / "retrieval.jsonl").open("w", encoding="utf-8")

    def add(self, step: StepReport) -> None:
        """Note a photo; its retrieval is on disk when this returns."""
        self._steps.append(step)
        if step.image_id is None:
            return
        self._names[step.image_id] = step.name
        verified = set(step.verified)
        rejected = {pair.image_id2: pair for pair in step.rejected}
        line = {
            "name": step.name,
            "most_relevant": step.most_relevant,
            "candidates": [
                {
                    "name": self._names[candidate.image_id],
                    "cosine": round(candidate.cosine, 5),
                    "inliers": candidate.inliers,
                    "verified": self._names[candidate.image_id] in verified,
                    "rejected": _rejection(rejected.get(candidate.image_id)),
                }
                for candidate in step.candidates
            ],
        }
        self._retrieval.write(json.dumps(line, ensure_ascii=False) + "\n")
        self._retrieval.flush()

    def finish(
        self,
        models: Sequence[ModelSummary],
        why_not: Mapping[int, str],
        *,
        seconds: Mapping[str, float],
        events: Sequence[str],
    ) -> dict[str, Any]:
        """Write ``report.json`` and return its content.

        ``why_not``: image id → why it is in no model. ``seconds`` and ``events`` of the end.
        """
        model_of = {
            image_id: number
            for number, model in reversed(list(enumerate(models)))
            for image_id in model.reconstruction.reg_image_ids()
        }
        content = {
            "photos": [self._row(step, model_of, why_not) for step in self._steps],
            "models": [
                {
                    "path": f"{model.path.parent.name}/{model.path.name}",
                    "registered": model.num_registered,
                    "points3D": model.num_points,
                    "mean_reprojection_error_px": round(model.mean_reprojection_error_px, 4),
                    "mean_track_length": round(model.mean_track_length, 3),
                }
                for model in models
            ],
            "end": {"seconds": _rounded(seconds), "events": list(events)},
            "totals": self._totals(models, model_of, seconds),
        }
        write_json(self._output / "report.json", content)
        return content

    def close(self) -> None:
        self._retrieval.close()

    def _row(
        self, step: StepReport, model_of: Mapping[int, int], why_not: Mapping[int, str]
    ) -> dict[str, Any]:
        row: dict[str, Any] = {"name": step.name, "image_id": step.image_id}
        if step.image_id is None:
            assert step.skipped is not None
            row["skipped"] = {"reason": step.skipped.reason.value, "detail": step.skipped.detail}
            row["registered"] = False
            row["model"] = None
            return row
        model = model_of.get(step.image_id)
        row["skipped"] = None
        row["registered"] = model is not None
        row["model"] = model
        row["why_not_registered"] = why_not.get(step.image_id)
        row["keypoints"] = step.num_keypoints
        row["most_relevant"] = step.most_relevant
        row["verified_pairs"] = len(step.verified)
        row["rejected_pairs"] = len(step.rejected)
        row["placed_by_this_step"] = list(step.registered)
        row["seconds"] = _rounded(step.seconds)
        row["events"] = list(step.events)
        return row

    def _totals(
        self,
        models: Sequence[ModelSummary],
        model_of: Mapping[int, int],
        seconds: Mapping[str, float],
    ) -> dict[str, Any]:
        by_stage: Counter[str] = Counter(dict(seconds))
        for step in self._steps:
            by_stage.update(step.seconds)
        points = sum(model.num_points for model in models)
        error = sum(model.mean_reprojection_error_px * model.num_points for model in models)
        return {
            "photos": len(self._steps),
            "used": len(self._names),
            "skipped": len(self._steps) - len(self._names),
            "registered": len(model_of),
            "models": len(models),
            "points3D": points,
            "mean_reprojection_error_px": round(error / points, 4) if points else None,
            "wall_seconds": round(time.perf_counter() - self._started, 3),
            "seconds_by_stage": _rounded(by_stage),
            "median_seconds_by_quarter": self._median_seconds_by_quarter(),
            "peak_memory_bytes": _peak_memory_bytes(),
        }

    def _median_seconds_by_quarter(self) -> list[float]:
        """Work on a photo in its turn by quarter of the session, global refinement apart.

        It should not grow once there are as many photos as candidates. What runs ahead is left
        out: beside a growing model it waits longer for the processor.
        """
        left_out = PREFETCHED_STAGES | {"refine"}
        work = [
            sum(seconds for stage, seconds in step.seconds.items() if stage not in left_out)
            for step in self._steps
            if step.image_id is not None
        ]
        bounds = [len(work) * quarter // 4 for quarter in range(5)]
        return [
            round(statistics.median(work[start:end]), 4)
            for start, end in pairwise(bounds)
            if end > start
        ]


def _rejection(pair: RejectedPair | None) -> dict[str, Any] | None:
    """Why a candidate has no verified pair; None if it has one, or was not matched."""
    if pair is None:
        return None
    return {
        "reason": pair.reason.value,
        "matches": pair.num_matches,
        "inliers": pair.num_inliers,
    }


def _rounded(seconds: Mapping[str, float]) -> dict[str, float]:
    return {stage: round(value, 4) for stage, value in seconds.items()}


def _peak_memory_bytes() -> int | None:
    """None on systems that do not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    return peak if sys.platform == "darwin" else peak * 1024
