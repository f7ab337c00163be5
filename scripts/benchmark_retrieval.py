"""Compare our retrieval with the paper's rivals on the same photos, in one run.

A DATASET is KIND:FOLDER. pool: scenes, each a folder with its photos in images/; two photos are
relevant to each other if they share points in a COLMAP model. holidays, oxford5k, paris6k,
roxford5k, rparis6k: the published datasets, photos and ground truth as unpacked.
"""

from __future__ import annotations

import argparse
import sys
import zlib  # noqa: F401  (before pycolmap)
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import pycolmap

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.streams import unfailing_streams
from sfm_front.errors import ConfigError, SfmFrontError
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.reconstruction.chart import check_matplotlib
from sfm_front.evaluation.retrieval.chart import write_chart
from sfm_front.evaluation.retrieval.figures.writing import FigureWriter
from sfm_front.evaluation.retrieval.methods import METHODS
from sfm_front.evaluation.retrieval.run import OURS, RetrievalSettings, run
from sfm_front.evaluation.retrieval.table import format_table, write_csv
from sfm_front.features.global_descriptors.cnn import NETWORKS
from sfm_front.retrieval.rerank import RerankOptions
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.session.options import available_cores
from sfm_front.storage.json_files import write_json


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("datasets", nargs="+", metavar="DATASET", help="such as pool:photos/")
    parser.add_argument(
        "--methods",
        metavar="NAMES",
        help=f"separated by commas, from {', '.join(METHODS)}; {OURS}:VECTOR is ours with another "
        "global vector (default: all but networks without --weights)",
    )
    parser.add_argument(
        "--weights",
        action="append",
        default=[],
        metavar="NETWORK=FILE",
        help=f"weights of {', '.join(NETWORKS)}; may be given several times",
    )
    parser.add_argument(
        "--models", type=Path, metavar="DIR", help="of a pool's scenes; missing ones are built"
    )
    parser.add_argument(
        "--min-shared", type=int, default=20, metavar="N", help="points, in a pool (default: 20)"
    )
    parser.add_argument(
        "--scale", type=int, metavar="N", help="fill each index with distractors up to N photos"
    )
    parser.add_argument("--queries", type=int, metavar="N", help="ask N at random (default: all)")
    parser.add_argument("--candidates", type=int, default=25, metavar="N", help="of ours")
    parser.add_argument("--rerank-features", type=int, default=800, metavar="N", help="of ours")
    parser.add_argument("--max-image-size", type=int, default=1600, metavar="PX")
    parser.add_argument("--max-features", type=int, default=4000, metavar="N", help="per photo")
    parser.add_argument("--threads", type=int, metavar="N", help="(default: all cores)")
    parser.add_argument(
        "--cache",
        type=Path,
        default=Path("outputs/retrieval_cache"),
        metavar="DIR",
        help="keeps the described photos (default: %(default)s)",
    )
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the table")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every figure")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="write a bar chart")
    parser.add_argument(
        "--paper-figures",
        type=Path,
        metavar="DIR",
        help="draw answers, global vectors in a plane and first layers for a few queries",
    )
    return parser.parse_args(argv)


def settings_of(args: argparse.Namespace) -> RetrievalSettings:
    weights = dict(parse_weights(text) for text in args.weights)
    methods = args.methods.split(",") if args.methods else default_methods(weights)
    return RetrievalSettings(
        datasets=args.datasets,
        methods=[name for name in methods if name],
        threads=available_cores() if args.threads is None else args.threads,
        cache=args.cache,
        models=args.models,
        min_shared=args.min_shared,
        weights=weights,
        max_image_size_px=args.max_image_size,
        max_features=args.max_features,
        scale=args.scale,
        num_queries=args.queries,
        retrieval=RetrievalOptions(candidates=args.candidates),
        rerank=RerankOptions(max_features=args.rerank_features),
    )


def parse_weights(text: str) -> tuple[str, Path]:
    network, _, file = text.partition("=")
    if network not in NETWORKS or not file:
        raise ConfigError(f"--weights {text}: give NETWORK=FILE, with one of {', '.join(NETWORKS)}")
    return network, Path(file)


def default_methods(weights: Mapping[str, Path]) -> list[str]:
    """All methods that need no download."""
    return [name for name in METHODS if name not in NETWORKS or name in weights]


def benchmark(args: argparse.Namespace) -> None:
    settings = settings_of(args)
    if args.figure or args.paper_figures:
        check_matplotlib()
    figures = FigureWriter(args.paper_figures) if args.paper_figures else None
    outcomes = run(settings, lambda line: print(line, file=sys.stderr, flush=True), figures)
    print(format_table(outcomes))
    if args.csv:
        write_csv(outcomes, args.csv)
    if args.json:
        content = {
            "settings": asdict(settings),
            "machine": machine(),
            "outcomes": [outcome.as_dict() for outcome in outcomes],
        }
        write_json(args.json, content)
    if args.figure:
        methods = {outcome.method for outcome in outcomes}
        write_chart(
            outcomes,
            args.figure,
            highlighted=[name for name in methods if name.split(":")[0] == OURS],
        )


def main() -> int:
    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value  # else one line per query
    try:
        with unfailing_streams():
            benchmark(parse())
    except SfmFrontError as error:
        print(f"benchmark_retrieval: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
