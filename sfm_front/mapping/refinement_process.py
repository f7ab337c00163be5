"""Bundle-adjusts whole models in a process of its own: ``background_refinement`` runs it.

pycolmap holds the interpreter's lock while it adjusts, so that a thread could not do this beside a
session. Each line of standard input is a request in JSON, answered by a line on standard output.
"""

from __future__ import annotations

import json
import os
import sys
import zlib  # noqa: F401  (before pycolmap)

import pycolmap


def adjust(request: dict[str, object]) -> None:
    """Read the model in the folder ``model``, adjust it, and write it back."""
    folder = str(request["model"])
    reconstruction = pycolmap.Reconstruction(folder)
    options = pycolmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.refine_focal_length = options.refine_extra_params = bool(request["refine_intrinsics"])
    solver = options.ceres.solver_options
    solver.function_tolerance = float(str(request["tolerance"]))
    solver.max_num_iterations = int(str(request["iterations"]))
    solver.num_threads = int(str(request["num_threads"]))
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in reconstruction.reg_image_ids():
        config.add_image(image_id)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    pycolmap.create_default_bundle_adjuster(options, config, reconstruction).solve()
    reconstruction.write_binary(folder)


def main() -> None:
    """Answer requests until standard input ends: with its session."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    # Whatever libraries print is not an answer.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if hasattr(os, "nice"):
        os.nice(5)  # photos come first
    for line in sys.stdin:
        try:
            adjust(json.loads(line))
            answer = "done"
        except (ValueError, RuntimeError, OSError, KeyError) as error:
            answer = f"failed: {error}".splitlines()[0]
        print(answer, file=answers, flush=True)


if __name__ == "__main__":
    main()
