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
from sfm_front.errors import SfmFrontError
from sfm_front.evaluation.georeference.table import format_trials
from sfm_front.evaluation.georeference.trial import GeoreferenceTrial, run_trial
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.tuning.scene_arguments import (
    add_scene_arguments,
    chosen_options,
    chosen_scenes,
    chosen_settings,
)
from sfm_front.evaluation.tuning.trials import counter, describe
from sfm_front.storage.json_files import write_json


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

    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value  # a line per failed step
    done: list[GeoreferenceTrial] = []
    for scene in scenes:
        described = describe(scene, args.cache, options, count)
        done.append(run_trial(scene.name, described, options, count))
        progress.note(f"{scene.name}: {done[-1].state}")
        if args.json:
            content = {
                "settings": chosen_settings(args),
                "machine": machine(),
                "trials": [asdict(trial) for trial in done],
            }
            write_json(args.json, content)
    progress.end()
    print(format_trials(done))


def main() -> int:
    try:
        run(parse())
    except SfmFrontError as error:
        print(f"benchmark_georeference: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
