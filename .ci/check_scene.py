"""Fail unless a finished run registered all photos and agrees with ground-truth poses."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pycolmap

from sfm_front.evaluation.poses import auc, pose_errors

MIN_AUC_AT_5_DEG = 0.9


def main() -> int:
    """check_scene.py OUTPUT GROUND_TRUTH NUM_PHOTOS"""
    output, truth, num_photos = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    report = json.loads((output / "report.json").read_text(encoding="utf-8"))
    model = pycolmap.Reconstruction(output / "sparse" / "0")
    registered = model.num_reg_images()
    errors = pose_errors(pycolmap.Reconstruction(truth), [model])
    at_5_deg = auc(errors, [5.0])[0]
    print(f"registered {registered} of {num_photos}, pose AUC at 5 degrees {at_5_deg:.3f}")
    in_report = report["models"][0]["registered"]
    good = registered == num_photos == in_report and at_5_deg >= MIN_AUC_AT_5_DEG
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
