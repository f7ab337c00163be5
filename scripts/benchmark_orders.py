"""Reconstruct scenes in many orders of arrival, and say how much the order decides.

Photos are described once and kept in --cache; each order gets a session of its own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.progress import CountLine
from sfm_front.errors import SfmFrontError
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.robustness.tables import format_orders
from sfm_front.evaluation.tuning.arrangements import check_arrangements
from sfm_front.evaluation.tuning.scene_arguments import (
    add_scene_arguments,
    chosen_options,
    chosen_scenes,
    chosen_settings,
)
from sfm_front.evaluation.tuning.trials import Trial, counter, describe, num_photos, try_scene
from sfm_front.storage.json_files import write_json


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    add_scene_arguments(parser)
    parser.add_argument(
        "--arrangements",
        default=",".join(f"shuffle-{seed}" for seed in range(1, 11)),
        metavar="NAMES",
        help="separated by commas: name, shuffle-SEED, flights (the first and the last 40 %% in "
        "turn, then the middle), each also as half-NAME or third-NAME (default: %(default)s)",
    )
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    arrangements = args.arrangements.split(",")
    check_arrangements(arrangements)
    options = chosen_options(args)
    scenes = chosen_scenes(args)
    progress = CountLine("photo", sys.stderr)
    total = sum(num_photos(scene, arrangements) for scene in scenes)
    count = counter(progress.show, total)

    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value  # a line per failed step
    done: list[Trial] = []
    for scene in scenes:
        described = describe(scene, args.cache, options, count)
        done += try_scene(scene, described, arrangements, [options], count).values()
        progress.note(f"{scene.name}: reconstructed")
        if args.json:
            content = {
                "settings": chosen_settings(args),
                "machine": machine(),
                "trials": [asdict(trial) for trial in done],
            }
            write_json(args.json, content)
    progress.end()
    print(format_orders(done))


def main() -> int:
    try:
        run(parse())
    except SfmFrontError as error:
        print(f"benchmark_orders: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
