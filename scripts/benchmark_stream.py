"""Measure the cost of a photo by its place in a long stream, on a synthetic flight.

Features and ground truth are given; nothing is read or detected: a photo is timed from retrieval
to mapping. Of several lengths each is flown in a process of its own, and a fit to them says what
10 000 photos would take.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import zlib  # noqa: F401  (before pycolmap)
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.streams import unfailing_streams
from sfm_front.errors import ConfigError, SfmFrontError
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.poses import AUC_THRESHOLDS_DEG
from sfm_front.evaluation.reconstruction.scale import format_scale, read_result
from sfm_front.evaluation.reconstruction.stream import PhotoCost, StreamResult, run_stream
from sfm_front.events import PhotoAdded
from sfm_front.mapping.atlas import AtlasOptions
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.session.options import SessionOptions, available_cores
from sfm_front.storage.json_files import write_json

_MIN_PHOTOS = 200
# What the fit to several lengths is asked for.
_FIT_TO = 10_000


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--photos", type=int, nargs="+", default=[1000], metavar="N", help="(default: 1000)"
    )
    parser.add_argument("--points", type=int, default=1000, metavar="N", help="points per photo")
    parser.add_argument("--threads", type=int, metavar="N", help="(default: all cores)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--cache-mb", type=int, metavar="MB", help="memory for features of earlier photos"
    )
    parser.add_argument(
        "--gps-noise",
        type=float,
        metavar="METRES",
        help="photos have positions, with this standard deviation along each axis",
    )
    parser.add_argument(
        "--lens",
        type=float,
        nargs=3,
        metavar=("K1", "P1", "P2"),
        help="distortion of the camera, instead of a radial one of -0.03",
    )
    parser.add_argument(
        "--json",
        type=Path,
        metavar="FILE",
        help="write every photo's figures; of several lengths, one file each, FILE.N.json",
    )
    parser.add_argument(
        "--compare",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="fly nothing: the table of what --json has written",
    )
    return parser.parse_args(argv)


def run(args: argparse.Namespace, given: Sequence[str]) -> None:
    if args.compare:
        print(format_scale([read_result(file) for file in args.compare], _FIT_TO))
        return
    for number in args.photos:
        if number < _MIN_PHOTOS:
            raise ConfigError(f"--photos must be at least {_MIN_PHOTOS}, got {number}")
    if len(args.photos) == 1:
        run_one(args, args.photos[0])
        return
    with TemporaryDirectory(prefix="sfm_front_scale_") as folder:
        base = args.json or Path(folder) / "stream"
        files = {number: base.with_name(f"{base.name}.{number}.json") for number in args.photos}
        for number, file in files.items():
            # The peak of memory is that of a process. Of an option, the last value counts.
            again = [sys.executable, __file__, *given, "--photos", str(number), "--json", str(file)]
            if subprocess.run(again, check=False).returncode:
                raise ConfigError(f"the flight of {number} photos has failed")
        print(format_scale([read_result(file) for file in files.values()], _FIT_TO))


def run_one(args: argparse.Namespace, num_photos: int) -> None:
    threads = available_cores() if args.threads is None else args.threads
    options = SessionOptions(
        global_descriptor="vlad",
        threads=threads,
        cache_mb=args.cache_mb,
        atlas=AtlasOptions(mapper=MapperOptions(num_threads=threads, seed=args.seed)),
    )
    with TemporaryDirectory(prefix="sfm_front_stream_") as output:
        result = run_stream(
            num_photos,
            args.points,
            Path(output),
            options,
            seed=args.seed,
            note=tell,
            gps_noise_m=args.gps_noise,
            lens=tuple(args.lens) if args.lens else None,
        )
    print(format_result(result))
    if args.json:
        write_json(args.json, {"machine": machine(), "threads": threads, **asdict(result)})


def tell(photo: PhotoAdded) -> None:
    if photo.image_id % 50 == 0:
        print(
            f"photo {photo.image_id}: {photo.num_registered} registered, {photo.num_points} points",
            file=sys.stderr,
            flush=True,
        )


def format_result(result: StreamResult) -> str:
    count = len(result.photos)
    bounds = [*range(0, count, 100), count]
    lines = ["photos         seconds  with refinement  amortized  CPU seconds  memory MiB"]
    amortized = result.amortized_seconds()
    lines += [
        _line(start, end, result.photos[start:end], float(np.mean(amortized[start:end])))
        for start, end in pairwise(bounds)
        if end - start > 1
    ]
    early, late = slice(100, 200), slice(min(900, count - 100), min(1000, count))
    areas = ", ".join(
        f"{100 * area:.1f} at {threshold:g}°"
        for threshold, area in zip(AUC_THRESHOLDS_DEG, result.auc, strict=True)
    )
    per_photo = result.memory_per_photo(100)
    growth = result.growth(early, late)
    lines += [
        f"growth from photos 100-200 to {late.start}-{late.stop}: {growth.seconds:.2f}, "
        f"with global refinement {growth.seconds_with_refinement:.2f}, "
        f"amortized {growth.amortized_seconds:.2f}, "
        f"CPU seconds {growth.processor_seconds:.2f}",
        f"CPU seconds follow the photo's number to the power {result.exponent(100):.2f}",
        "memory per photo: " + ("-" if per_photo is None else f"{per_photo / 2**20:.2f} MiB"),
        f"memory in MiB: {_mib(result.memory.at_start)} before the first photo, at most "
        f"{_mib(result.peak_in_stream)} while they came, {_mib(result.memory.peak)} at all; "
        f"of that pycolmap's graph and models {_mib(result.memory.colmap)}",
        f"end of the session: {result.finish_seconds:.1f} s, "
        f"CPU seconds {result.finish_processor_seconds:.1f}; "
        f"of the process beside it {result.beside_processor_seconds:.1f}",
        f"{result.num_registered} of {count} photos in the largest model; pose AUC {areas}"
        + ("" if result.bend_share is None else f"; bend {result.bend_share:.2%} of the extent"),
    ]
    return "\n".join(lines)


def _line(start: int, end: int, photos: Sequence[PhotoCost], amortized: float) -> str:
    seconds = np.mean([photo.seconds for photo in photos])
    refined = np.mean([photo.seconds_with_refinement for photo in photos])
    processor = np.mean([photo.processor_seconds for photo in photos])
    return (
        f"{f'{start}-{end}':<12}{seconds:>10.3f}{refined:>17.3f}{amortized:>11.3f}"
        f"{processor:>13.3f}{_mib(photos[-1].memory_bytes):>12}"
    )


def _mib(num_bytes: int | None) -> str:
    return "-" if num_bytes is None else f"{num_bytes / 2**20:.0f}"


def main() -> int:
    try:
        with unfailing_streams():
            run(parse(), sys.argv[1:])
    except SfmFrontError as error:
        print(f"benchmark_stream: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
