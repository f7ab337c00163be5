"""Measure a cluster of this machine beside one process, on the same synthetic flight.

Features and ground truth are given; nothing is read or detected: what is compared is retrieval,
matching and mapping, and how well the models of groups become one.
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

from sfm_front.cli.streams import unfailing_streams
from sfm_front.cluster.options import ClusterOptions, check_installed
from sfm_front.errors import ConfigError
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.scaling.trial import Flight, FlightResult
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.evaluation.tuning.scene_script import exit_status
from sfm_front.session.options import SessionOptions, available_cores
from sfm_front.storage.json_files import write_json


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photos", type=int, default=2000, metavar="N", help="(default: 2000)")
    parser.add_argument("--points", type=int, default=700, metavar="N", help="per photo (700)")
    parser.add_argument(
        "--workers", type=int, nargs="+", default=[2], metavar="N", help="(default: 2)"
    )
    parser.add_argument("--group-size", type=int, default=ClusterOptions.group_size, metavar="N")
    parser.add_argument(
        "--gps-noise",
        type=float,
        metavar="METRES",
        help="photos have positions, with this standard deviation along each axis",
    )
    parser.add_argument("--threads", type=int, metavar="N", help="(default: all cores)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures")
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    check_installed()
    if args.photos < args.group_size:
        raise ConfigError(f"--photos must be at least --group-size, got {args.photos}")
    threads = available_cores() if args.threads is None else args.threads
    options = SessionOptions(global_descriptor="vlad", threads=threads, seed=args.seed)
    scene = make_scene(args.photos, args.points, seed=args.seed, layout="strip")
    flight = Flight(scene, options, args.gps_noise)
    results: dict[str, FlightResult] = {}
    with TemporaryDirectory(prefix="sfm_front_cluster_") as folder:
        results["one process"] = flight.through_one_process(Path(folder) / "alone", tell)
        for number in args.workers:
            photos = Path(folder) / f"photos{number}"
            photos.mkdir()
            results[f"local:{number}"] = flight.through_cluster(
                Path(folder) / f"cluster{number}",
                photos,
                ClusterOptions(address=f"local:{number}", group_size=args.group_size),
                tell,
            )
    print(format_results(results))
    if args.json:
        figures = {name: asdict(result) for name, result in results.items()}
        write_json(args.json, {"machine": machine(), "threads": threads, **figures})


def tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def format_results(results: dict[str, FlightResult]) -> str:
    """Markdown: a line for each way of going about it."""
    alone = results["one process"]
    lines = [
        "| | wall, s | of one process | in the largest model | models | AUC at 1, 3, 5° "
        "| from GPS, m |",
        "|---" * 7 + "|",
    ]
    for name, result in results.items():
        areas = ", ".join(f"{100 * area:.1f}" for area in result.auc)
        gps = "-" if result.gps_residual_m is None else f"{result.gps_residual_m:.2f}"
        lines.append(
            f"| {name} | {result.seconds:.1f} | {result.seconds / alone.seconds:.2f} "
            f"| {result.num_registered} | {result.num_models} | {areas} | {gps} |"
        )
    return "\n".join(lines)


def main() -> int:
    with unfailing_streams():
        return exit_status("benchmark_cluster", parse, run)


if __name__ == "__main__":
    raise SystemExit(main())
