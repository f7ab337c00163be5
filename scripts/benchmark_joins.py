"""Measure how flights that meet late become one model, on synthetic ones with known truth.

Two flights that five bridge photos join, taken last, beside the same photos in order; and a round
trip, beside a model that is grown from all its pairs at once.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import zlib  # noqa: F401  (before pycolmap)

from sfm_front.cli.progress import CountLine
from sfm_front.cli.streams import unfailing_streams
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.poses import AUC_THRESHOLDS_DEG
from sfm_front.evaluation.robustness.long_ways import Flown, round_trip, two_flights
from sfm_front.evaluation.tuning.scene_script import exit_status
from sfm_front.session.options import SessionOptions, available_cores
from sfm_front.storage.json_files import write_json


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--flight", type=int, default=300, metavar="N", help="photos of each of the two (300)"
    )
    parser.add_argument(
        "--round-trip", type=int, default=400, metavar="N", help="photos of it (400)"
    )
    parser.add_argument("--points", type=int, default=700, metavar="N", help="per photo (700)")
    parser.add_argument("--threads", type=int, metavar="N", help="(default: all cores)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures")
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    threads = available_cores() if args.threads is None else args.threads
    options = SessionOptions(global_descriptor="vlad", threads=threads, seed=args.seed)
    total = 2 * (2 * args.flight + 5) + args.round_trip
    progress, done = CountLine("photo", sys.stderr), iter(range(1, total + 1))
    results: dict[str, Flown | tuple[float, ...]] = {}
    for name, bridges_last in (("bridges last", True), ("in order", False)):
        with TemporaryDirectory(prefix="sfm_front_joins_") as output:
            results[name] = two_flights(
                args.flight,
                args.points,
                Path(output),
                options,
                bridges_last=bridges_last,
                seed=args.seed,
                note=lambda _: progress.show(next(done), total),
            )
    with TemporaryDirectory(prefix="sfm_front_joins_") as output:
        results["round trip"], results["all pairs at once"] = round_trip(
            args.round_trip,
            args.points,
            Path(output),
            options,
            seed=args.seed,
            note=lambda _: progress.show(next(done), total),
        )
    progress.end()
    print(f"two flights of {args.flight}, round trip of {args.round_trip} photos; pose AUC at")
    print("  " + ", ".join(f"{threshold:g}°" for threshold in AUC_THRESHOLDS_DEG))
    for name, result in results.items():
        areas = result.auc if isinstance(result, Flown) else result
        words = [f"{name}: " + ", ".join(f"{100 * area:.1f}" for area in areas)]
        if isinstance(result, Flown):
            words.append(f"{result.num_registered} of {len(result.seconds)} photos in one model")
            words += [
                f"joined in the turn of photo {row + 1}, {result.seconds[row]:.1f} s"
                for row in result.joined_at
            ]
        print("; ".join(words))
    if args.json:
        plain = {
            name: asdict(result) if isinstance(result, Flown) else result
            for name, result in results.items()
        }
        write_json(args.json, {"machine": machine(), "threads": threads, **plain})


def main() -> int:
    with unfailing_streams():
        return exit_status("benchmark_joins", parse, run)


if __name__ == "__main__":
    raise SystemExit(main())
