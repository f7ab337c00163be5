"""Compare how many photos ours and COLMAP's exhaustive pipeline register when photos are left out.

Each scene is taken as a whole, with every second and with every third of its photos in order of
name. COLMAP gets them all at once, ours in order of name and shuffled twice, both at the same size
and number of features. COLMAP's models are kept in --rivals, our features in --cache.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.progress import CountLine
from sfm_front.errors import ConfigError
from sfm_front.evaluation.reconstruction.scenes import with_landmarks
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings
from sfm_front.evaluation.robustness.sparse import ORDERS, Comparison, compare
from sfm_front.evaluation.robustness.tables import format_comparisons
from sfm_front.evaluation.tuning.arrangements import THINNINGS
from sfm_front.evaluation.tuning.scene_arguments import (
    add_scene_arguments,
    chosen_options,
    chosen_scenes,
)
from sfm_front.evaluation.tuning.scene_script import exit_status, write_figures
from sfm_front.evaluation.tuning.trials import counter, describe, num_photos


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    add_scene_arguments(parser)
    parser.add_argument(
        "--thinnings",
        default=",".join(THINNINGS),
        metavar="NAMES",
        help="separated by commas (default: %(default)s)",
    )
    parser.add_argument(
        "--rivals",
        type=Path,
        default=Path("outputs/sparse_rivals"),
        metavar="DIR",
        help="keeps COLMAP's models (default: %(default)s)",
    )
    parser.add_argument(
        "--landmarks",
        default="",
        metavar="NAMES",
        help="scenes of several landmarks, which their photos are named after and numbered: "
        "counts models that mix them",
    )
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    thinnings = args.thinnings.split(",")
    unknown = [name for name in thinnings if name not in THINNINGS]
    if unknown:
        raise ConfigError(f"--thinnings: {unknown[0]} unknown; there are {', '.join(THINNINGS)}")
    options = chosen_options(args)
    rival_settings = BenchmarkSettings(
        threads=options.threads,
        max_image_size_px=options.max_image_size,
        max_features=options.max_features,
    )
    scenes = [
        with_landmarks(scene) if scene.name in args.landmarks.split(",") else scene
        for scene in chosen_scenes(args)
    ]
    progress = CountLine("photo", sys.stderr)
    arrangements = [f"{thinning}-{order}" for thinning in thinnings for order in ORDERS]
    total = sum(num_photos(scene, arrangements) for scene in scenes)
    count = counter(progress.show, total)
    done: list[Comparison] = []
    for scene in scenes:
        described = describe(scene, args.cache, options, count)
        for thinning in thinnings:
            done.append(
                compare(scene, described, thinning, args.rivals, rival_settings, options, count)
            )
        progress.note(f"{scene.name}: compared")
        write_figures(
            args, "comparisons", [one.as_dict() for one in done], **asdict(rival_settings)
        )
    progress.end()
    print(format_comparisons(done))


def main() -> int:
    return exit_status("benchmark_sparse", parse, run)


if __name__ == "__main__":
    raise SystemExit(main())
