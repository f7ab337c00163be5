"""Stop reconstructions of real photos at random moments, go on with them, and check what is left.

A SCENE holds photos, or has them in its images/. Ground truth is looked for in its gt/. Each strike
is SIGKILL, SIGTERM, SIGINT or a full disk, at a moment drawn over the time of an undisturbed run; a
quarter wait for the next write to the database, a quarter for models to be written. The same
command follows, which may be struck in turn, until one ends.
"""

from __future__ import annotations

import argparse
import os
import sys
import zlib  # noqa: F401  Before pycolmap, which exports one of its own.
from collections.abc import Sequence
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.streams import unfailing_streams
from sfm_front.errors import ConfigError, SfmFrontError
from sfm_front.evaluation.crashes.campaign import format_report, strike_at_random
from sfm_front.evaluation.crashes.power_cuts import cut_at_random, format_cuts
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.reconstruction.scenes import find_scene
from sfm_front.session.options import available_cores
from sfm_front.storage.json_files import write_json

RECONSTRUCT = [sys.executable, str(Path(__file__).resolve().parent / "reconstruct.py")]


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path, metavar="SCENE")
    parser.add_argument("--kills", type=int, default=50, metavar="N", help="(default: 50)")
    parser.add_argument(
        "--power-cuts",
        type=int,
        default=0,
        metavar="N",
        help="instead, cut the write-ahead log of copies of the database at N random places",
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--max-image-size", type=int, default=800, metavar="PX")
    parser.add_argument("--max-features", type=int, default=2000, metavar="N")
    parser.add_argument("--threads", type=int, metavar="N", help="(default: all cores)")
    parser.add_argument(
        "--snapshot-seconds",
        type=float,
        default=1.0,
        metavar="S",
        help="as of reconstruct; short, so that there are models to be struck (default: 1)",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every strike")
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> int:
    """1 if something that must hold did not."""
    if args.kills < 1 or args.power_cuts < 0:
        raise ConfigError("--kills must be at least 1, --power-cuts at least 0")
    scene = find_scene(args.scene)
    settings = {
        "--max-image-size": args.max_image_size,
        "--max-features": args.max_features,
        "--threads": available_cores() if args.threads is None else args.threads,
        "--snapshot-seconds": args.snapshot_seconds,
        "--global-descriptor": "vlad",
    }
    with TemporaryDirectory(prefix="sfm_front_crashes_") as scratch:
        output = Path(scratch) / "output"
        command = [
            *(*RECONSTRUCT, str(scene.photos), "--output", str(output)),
            *(str(part) for option in settings.items() for part in option),
        ]
        if args.power_cuts:
            cuts = cut_at_random(scene, command, output, args.power_cuts, seed=args.seed, note=tell)
            print(format_cuts(cuts))
            content, violations = asdict(cuts), cuts.violations
        else:
            report = strike_at_random(scene, command, output, args.kills, seed=args.seed, note=tell)
            print(format_report(report))
            content, violations = asdict(report), report.violations
    if args.json:
        write_json(
            args.json, {"machine": machine(), "settings": settings, "result": plain(content)}
        )
    return 1 if violations else 0


def plain(value: object) -> object:
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        parts = sorted(value) if isinstance(value, set | frozenset) else value
        return [plain(part) for part in parts]
    return value.value if isinstance(value, Enum) else value


def tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def main() -> int:
    if os.name == "nt":
        print("benchmark_crashes: needs the signals of POSIX", file=sys.stderr)
        return 2
    try:
        with unfailing_streams():
            return run(parse())
    except SfmFrontError as error:
        print(f"benchmark_crashes: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    raise SystemExit(main())
