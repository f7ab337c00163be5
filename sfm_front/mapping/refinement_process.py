"""Bundle-adjusts whole models in a process of its own: FOLDER; ``background_refinement`` runs it.

pycolmap holds the interpreter's lock while it adjusts, so that a thread could not do this beside a
session. Each line of standard input is a request in JSON, answered by a line on standard output.
FOLDER holds the models, and goes with the session, also with one that was killed.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import zlib  # noqa: F401  (before pycolmap)
from contextlib import suppress
from dataclasses import dataclass

import pycolmap

from sfm_front.mapping.bundle_adjustment import solved_directly


@dataclass(frozen=True, kw_only=True)
class AdjustmentRequest:
    """Adjust the model in the folder ``model`` in place, with at most so many iterations.

    ``tolerance``: relative change of the cost at which it stops.
    """

    model: str
    tolerance: float
    iterations: int
    num_threads: int
    refine_intrinsics: bool
    min_coverage_gain: float


def adjust(request: AdjustmentRequest) -> None:
    """Read the model, adjust it, and write it back."""
    reconstruction = pycolmap.Reconstruction(request.model)
    adjustment = solved_directly(pycolmap.BundleAdjustmentOptions())
    adjustment.refine_focal_length = request.refine_intrinsics
    adjustment.refine_extra_params = request.refine_intrinsics
    solver = adjustment.ceres.solver_options
    solver.function_tolerance = request.tolerance
    solver.max_num_iterations = request.iterations
    solver.num_threads = request.num_threads
    options = pycolmap.IncrementalMapperOptions()
    options.ba_global_ignore_redundant_points3D = True
    options.ba_global_prune_points_min_coverage_gain = request.min_coverage_gain
    mapper = pycolmap.IncrementalMapper(_cache_of(reconstruction))
    mapper.begin_reconstruction(reconstruction)
    mapper.adjust_global_bundle(options, adjustment)
    mapper.end_reconstruction(False)
    reconstruction.write_binary(request.model)


def _cache_of(reconstruction: pycolmap.Reconstruction) -> pycolmap.DatabaseCache:
    """What a mapper asks for, without the matches: an adjustment needs none."""
    cache = pycolmap.DatabaseCache()
    for camera in reconstruction.cameras.values():
        cache.add_camera(camera)
    for rig in reconstruction.rigs.values():
        cache.add_rig(rig)
    for frame in reconstruction.frames.values():
        cache.add_frame(frame)
    for image in reconstruction.images.values():
        cache.add_image(image)
    return cache


def main(folder: str) -> None:
    """Answer requests until standard input ends: with its session."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    # Whatever libraries print is not an answer.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    # Photos come first, but only where the system weighs processes one by one: if it waits longer,
    # photos are placed in a model that has drifted, and one may be lost.
    if hasattr(os, "nice"):
        os.nice(5)
    for line in sys.stdin:
        try:
            adjust(AdjustmentRequest(**json.loads(line)))
            answer = "done"
        except (ValueError, RuntimeError, OSError, TypeError) as error:
            answer = f"failed: {error}".splitlines()[0]
        with suppress(BrokenPipeError):  # Nobody waits for it any more.
            print(answer, file=answers, flush=True)
    shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main(sys.argv[1])
