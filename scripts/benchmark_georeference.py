"""Reconstruct scenes with GPS photo by photo, and say when their models are metric, and how well.

Photos are described once and kept in --cache; each scene gets a session in order of name. The table
compares the models as they are exported with GPS, without another fit and with the one that fits
best, and says how far they move from what was said first.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.progress import CountLine
from sfm_front.evaluation.georeference.table import format_trials
from sfm_front.evaluation.georeference.trial import GeoreferenceTrial, run_trial
from sfm_front.evaluation.tuning.scene_arguments import (
    add_scene_arguments,
    chosen_options,
    chosen_scenes,
)
from sfm_front.evaluation.tuning.scene_script import exit_status, write_figures
from sfm_front.evaluation.tuning.trials import counter, describe


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    add_scene_arguments(parser)
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    options = chosen_options(args)
    scenes = chosen_scenes(args)
    progress = CountLine("photo", sys.stderr)
    # Each is described and taken in.
    count = counter(progress.show, 2 * sum(scene.num_photos for scene in scenes))
    done: list[GeoreferenceTrial] = []
    for scene in scenes:
        described = describe(scene, args.cache, options, count)
        done.append(run_trial(scene.name, described, options, count))
        progress.note(f"{scene.name}: {done[-1].state}")
        write_figures(args, "trials", [asdict(trial) for trial in done])
    progress.end()
    print(format_trials(done))


def main() -> int:
    return exit_status("benchmark_georeference", parse, run)


if __name__ == "__main__":
    raise SystemExit(main())
