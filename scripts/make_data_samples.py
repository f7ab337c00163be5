"""Render data_samples/village: photos of a procedural village, with ground truth.

The same seed gives the same scene, flight and photos. See data_samples/README.md.
"""

from __future__ import annotations

import argparse
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from sample_scene.flight import CAMERA, plan_flight
from sample_scene.photo import save_photo
from sample_scene.render import camera_rays, photograph, prepare
from sample_scene.truth import true_model
from sample_scene.village import build_village

_NUM_TRUE_POINTS = 1500
_DEFAULT_OUTPUT = Path(__file__).resolve().parent.parent / "data_samples" / "village"


def main() -> None:
    """Render every photo of the flight and write ``images/`` and ``gt/`` below the output."""
    arguments = _parse()
    seed: int = arguments.seed
    images, truth = arguments.output / "images", arguments.output / "gt"
    images.mkdir(parents=True, exist_ok=True)
    truth.mkdir(parents=True, exist_ok=True)

    started = time.monotonic()
    stage = prepare(build_village(seed), seed)
    poses = plan_flight(seed)
    names = [f"{number:04d}.jpg" for number in range(1, len(poses) + 1)]
    rays = camera_rays(CAMERA)
    print(f"built {len(stage.mesh.triangles)} triangles in {time.monotonic() - started:.0f} s")

    with ThreadPoolExecutor(arguments.threads) as pool:
        jobs = [
            pool.submit(photograph, stage, CAMERA, rays, pose, seed + 1000 + number)
            for number, pose in enumerate(poses)
        ]
        pictures = []
        for number, (name, pose, job) in enumerate(zip(names, poses, jobs, strict=True)):
            pictures.append(job.result())
            save_photo(
                images / name,
                pictures[-1],
                number=number,
                camera=CAMERA,
                cam_from_world=pose,
                seed=seed + 2000 + number,
            )
            print(f"{name}: {time.monotonic() - started:.0f} s", flush=True)

    model = true_model(
        stage, CAMERA, poses, names, pictures, num_points=_NUM_TRUE_POINTS, seed=seed
    )
    model.write_text(truth)
    print(model.summary())


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=_DEFAULT_OUTPUT, metavar="DIR")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--threads", type=int, default=os.cpu_count(), metavar="N")
    return parser.parse_args()


if __name__ == "__main__":
    main()
