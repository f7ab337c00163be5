"""The arguments that scripts share which try sessions on the scenes of a folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.evaluation.tuning.trials import find_scenes
from sfm_front.session.options import SessionOptions


def add_scene_arguments(parser: argparse.ArgumentParser) -> None:
    """Which scenes, how sessions run, and where to keep what."""
    parser.add_argument(
        "--data", type=Path, required=True, metavar="FOLDER", help="holds a folder per scene"
    )
    parser.add_argument("--scenes", metavar="NAMES", help="separated by commas (default: all)")
    parser.add_argument(
        "--threads", type=int, default=1, metavar="N", help="1, the default, repeats to the bit"
    )
    parser.add_argument("--seed", type=int, default=0, help="of all RANSAC")
    parser.add_argument(
        "--cache",
        type=Path,
        default=Path("outputs/tuning_cache"),
        metavar="DIR",
        help="keeps what photos were described by (default: %(default)s)",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every figure")


def chosen_scenes(args: argparse.Namespace) -> list[BenchmarkScene]:
    """The scenes of ``--data`` in ``--scenes``. Raises ConfigError for one that does not exist."""
    return find_scenes(args.data, args.scenes.split(",") if args.scenes else None)


def chosen_options(args: argparse.Namespace) -> SessionOptions:
    """Raises ConfigError for values that cannot be."""
    return SessionOptions(global_descriptor="vlad", threads=args.threads, seed=args.seed)


def chosen_settings(args: argparse.Namespace) -> dict[str, object]:
    """What was asked for, ready for JSON."""
    return {
        "threads": args.threads,
        "seed": args.seed,
        "global_descriptor": "vlad",
        "data": args.data,
    }
