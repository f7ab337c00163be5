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
from sfm_front.evaluation.robustness.tables import format_orders
from sfm_front.evaluation.tuning.arrangements import check_arrangements
from sfm_front.evaluation.tuning.scene_arguments import (
    add_scene_arguments,
    chosen_options,
    chosen_scenes,
)
from sfm_front.evaluation.tuning.scene_script import exit_status, write_figures
from sfm_front.evaluation.tuning.trials import Trial, counter, describe, num_photos, try_scene


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
    done: list[Trial] = []
    for scene in scenes:
        described = describe(scene, args.cache, options, count)
        done += try_scene(scene, described, arrangements, [options], count).values()
        progress.note(f"{scene.name}: reconstructed")
        write_figures(args, "trials", [asdict(trial) for trial in done])
    progress.end()
    print(format_orders(done))


def main() -> int:
    return exit_status("benchmark_orders", parse, run)


if __name__ == "__main__":
    raise SystemExit(main())
