"""Try other values of tuned options on real scenes, and say what each costs or brings.

Photos are described once and kept in --cache; then each value gets a session per scene and
arrangement: all photos in order of name, shuffled twice, and every second one. Ctrl-C ends with
the scenes done so far.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.progress import CountLine
from sfm_front.errors import ConfigError
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.evaluation.tuning.arrangements import ARRANGEMENTS, check_arrangements
from sfm_front.evaluation.tuning.constants import CONSTANTS, Sweep, make_sweep
from sfm_front.evaluation.tuning.scene_arguments import (
    add_scene_arguments,
    chosen_options,
    chosen_scenes,
)
from sfm_front.evaluation.tuning.scene_script import exit_status, write_figures
from sfm_front.evaluation.tuning.table import format_sweep
from sfm_front.evaluation.tuning.trials import Trials, counter, describe, num_photos, try_scene
from sfm_front.reports.words import clock


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    listed = "".join(
        f"\n  {c.name}, {c.path}: {', '.join(map(str, c.values))}\n    {c.decides}"
        for c in CONSTANTS
    )
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog=f"Names, paths and the values tried:{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "names",
        nargs="+",
        metavar="NAME",
        help="one of those below, or the dotted path of any other option with --values",
    )
    parser.add_argument("--values", metavar="V,V,...", help="of one NAME, instead of its own")
    add_scene_arguments(parser)
    parser.add_argument(
        "--arrangements",
        default=",".join(ARRANGEMENTS),
        metavar="NAMES",
        help="separated by commas (default: %(default)s)",
    )
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    base = chosen_options(args)
    values = args.values.split(",") if args.values else None
    if values is not None and len(args.names) > 1:
        raise ConfigError("--values goes with one NAME")
    sweeps = [make_sweep(name, values, base) for name in args.names]
    arrangements = args.arrangements.split(",")
    check_arrangements(arrangements)
    scenes = chosen_scenes(args)
    # Sweeps share the session with the current value of all of them.
    options = list(dict.fromkeys(tried for sweep in sweeps for tried in sweep.options.values()))
    progress = CountLine("photo", sys.stderr)
    total = sum(num_photos(scene, arrangements, len(options)) for scene in scenes)
    count = counter(progress.show, total)
    trials: Trials = {}
    done: list[BenchmarkScene] = []
    try:
        for scene in scenes:
            started = perf_counter()
            described = describe(scene, args.cache, base, count)
            trials |= try_scene(scene, described, arrangements, options, count)
            done.append(scene)
            progress.note(f"{scene.name}: tried in {clock(perf_counter() - started)}")
            write_figures(args, "options", as_rows(sweeps, trials))
    except KeyboardInterrupt:
        if not done:
            raise
    progress.end()
    photos = sum(scene.num_photos for scene in done)
    print(f"{len(done)} of {len(scenes)} scenes, {photos} photos; * is the current value")
    for sweep in sweeps:
        print("\n" + format_sweep(sweep, trials))


def as_rows(sweeps: Sequence[Sweep], trials: Trials) -> list[dict[str, object]]:
    return [
        {
            "path": sweep.path,
            "current": sweep.current,
            "trials": [
                {"value": value, **asdict(trial)}
                for value, options in sweep.options.items()
                for key, trial in trials.items()
                if key.options == options
            ],
        }
        for sweep in sweeps
    ]


def main() -> int:
    return exit_status("tune", parse, run)


if __name__ == "__main__":
    raise SystemExit(main())
