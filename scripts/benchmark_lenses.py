"""Reconstruct scenes with true poses as if their photos had been taken through other lenses.

Photos are rendered from what they show undistorted; their poses stay. The table has the pose AUC at
1, 3 and 5 degrees by lens and camera model: auto, which lets the camera grow where the photos bear
it out, beside models that stay.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.progress import CountLine
from sfm_front.evaluation.lenses.rendering import LENSES, check_lenses
from sfm_front.evaluation.lenses.trials import MODELS, LensTrial, format_trials, try_lens
from sfm_front.evaluation.tuning.scene_arguments import (
    add_scene_arguments,
    chosen_options,
    chosen_scenes,
)
from sfm_front.evaluation.tuning.scene_script import exit_status, write_figures
from sfm_front.evaluation.tuning.trials import counter
from sfm_front.photos.cameras import CameraOptions


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    add_scene_arguments(parser)
    for name, known in (("lenses", tuple(LENSES)), ("models", MODELS)):
        parser.add_argument(
            f"--{name}",
            default=",".join(known),
            metavar="NAMES",
            help="separated by commas (default: %(default)s)",
        )
    parser.add_argument(
        "--renders",
        type=Path,
        default=Path("outputs/lens_renders"),
        metavar="DIR",
        help="gets the rendered photos (default: %(default)s)",
    )
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    lenses, models = args.lenses.split(","), args.models.split(",")
    check_lenses(lenses)
    options = chosen_options(args)
    for model in models:
        CameraOptions(model=model)
    scenes = chosen_scenes(args)
    progress = CountLine("photo", sys.stderr)
    photos = sum(scene.num_photos for scene in scenes)
    count = counter(progress.show, photos * len(lenses) * (1 + len(models)))
    done: list[LensTrial] = []
    for scene in scenes:
        for lens in lenses:
            done += try_lens(scene, lens, models, args.renders, args.cache, options, count)
            progress.note(f"{scene.name} through {lens}: tried")
            write_figures(args, "trials", [asdict(one) for one in done])
    progress.end()
    print(format_trials(done))


def main() -> int:
    return exit_status("benchmark_lenses", parse, run)


if __name__ == "__main__":
    raise SystemExit(main())
