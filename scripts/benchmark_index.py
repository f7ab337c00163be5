"""Measure a query of the retrieval index by the photos in it, on a synthetic flight.

Photos are added in the order in which they are taken. Recall is the share of the candidates that
exact search finds, too.
"""

from __future__ import annotations

import argparse
import sys
import zlib  # noqa: F401  (before pycolmap)
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.streams import unfailing_streams
from sfm_front.errors import SfmFrontError
from sfm_front.evaluation.retrieval.growing_index import IndexCost, measure_index
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.runtime.thread_limits import single_threaded_calls


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--photos",
        type=int,
        nargs="+",
        default=[1000, 10_000, 100_000],
        metavar="N",
        help="sizes of the index (default: 1000 10000 100000)",
    )
    parser.add_argument("--queries", type=int, default=100, metavar="N", help="at each size")
    parser.add_argument("--points", type=int, default=700, metavar="N", help="points per photo")
    parser.add_argument("--candidates", type=int, default=25, metavar="N")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    print("photos  median ms  worst ms  CPU ms  recall  memory MiB", flush=True)
    # Matrix products run on one thread, as they do in a session.
    with single_threaded_calls(opencv=False):
        measure_index(
            args.photos,
            args.queries,
            args.points,
            seed=args.seed,
            options=RetrievalOptions(candidates=args.candidates),
            note=lambda cost: print(_line(cost), flush=True),
        )


def _line(cost: IndexCost) -> str:
    memory = "-" if cost.memory_bytes is None else f"{cost.memory_bytes / 2**20:.0f}"
    return (
        f"{cost.num_photos:<8}{1e3 * cost.median_seconds:>9.1f}{1e3 * cost.worst_seconds:>10.1f}"
        f"{1e3 * cost.processor_seconds:>8.1f}{cost.recall:>8.3f}{memory:>12}"
    )


def main() -> int:
    try:
        with unfailing_streams():
            run(parse())
    except SfmFrontError as error:
        print(f"benchmark_index: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
