"""Predict how long clusters of 1 to 64 workers would take, from the reports of measured runs.

Tasks, transfers and the coordinator's own work cost what they did in the runs given, which are made
with ``reconstruct.py FOLDER --cluster local:1``; a discrete simulation puts them together.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.streams import unfailing_streams
from sfm_front.errors import SfmFrontError
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.scaling.costs import ClusterRun, Costs
from sfm_front.evaluation.scaling.simulation import ClusterShape, simulate
from sfm_front.evaluation.scaling.table import format_check, format_predictions, write_curves
from sfm_front.session.options import available_cores
from sfm_front.storage.json_files import write_json


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "reports", type=Path, nargs="+", help="report.json of runs with one --group-size"
    )
    parser.add_argument(
        "--against",
        type=Path,
        nargs="+",
        default=[],
        metavar="REPORT",
        help="runs on this machine's cores with other numbers of workers: how well it is foretold",
    )
    parser.add_argument(
        "--end",
        type=_photos_and_seconds,
        nargs="+",
        default=[],
        metavar="PHOTOS=SECONDS",
        help="what the end of larger sessions took, as benchmark_stream.py says",
    )
    parser.add_argument(
        "--photos", type=int, nargs="+", default=[1000, 10_000, 100_000], metavar="N"
    )
    parser.add_argument(
        "--workers", type=int, nargs="+", default=[1, 2, 4, 8, 16, 32, 64], metavar="N"
    )
    parser.add_argument(
        "--mbit", type=float, default=1000.0, help="of the network (default: %(default)s)"
    )
    parser.add_argument("--chart", type=Path, metavar="FILE", help="write the curves")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures")
    return parser.parse_args(argv)


def _photos_and_seconds(text: str) -> tuple[int, float]:
    photos, _, seconds = text.partition("=")
    try:
        found = int(photos), float(seconds)
    except ValueError:
        found = 0, 0.0
    if found[0] < 1 or not 0 < found[1] < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not PHOTOS=SECONDS, both above 0")
    return found


def run(args: argparse.Namespace) -> None:
    costs = Costs.of([ClusterRun.read(report) for report in args.reports], dict(args.end))
    cores = available_cores()
    checked = [
        (
            measured,
            # On one machine nothing goes over a network.
            simulate(
                costs,
                measured.num_photos,
                ClusterShape(
                    num_workers=measured.num_workers, num_cores=cores, bytes_per_second=1e9
                ),
            ),
        )
        for measured in (ClusterRun.read(report) for report in [*args.reports, *args.against])
    ]
    print(format_check(checked), end="\n\n", flush=True)
    predictions = {
        (photos, workers): simulate(
            costs,
            photos,
            ClusterShape(num_workers=workers, bytes_per_second=args.mbit * 125e3),
        )
        for photos in args.photos
        for workers in args.workers
    }
    print(format_predictions(predictions))
    if args.chart:
        write_curves(predictions, args.chart)
    if args.json:
        rows = [
            {"photos": photos, "workers": workers, **asdict(prediction)}
            for (photos, workers), prediction in predictions.items()
        ]
        write_json(args.json, {"machine": machine(), "costs": asdict(costs), "simulated": rows})


def main() -> int:
    try:
        with unfailing_streams():
            run(parse())
    except SfmFrontError as error:
        print(f"simulate_cluster: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
