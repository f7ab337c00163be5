"""Measure how long a photo that is copied to a watched folder waits for its pose.

The photos of a scene are copied there one by one, while ``reconstruct --watch`` takes them in a
process of its own.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.streams import unfailing_streams
from sfm_front.errors import SfmFrontError
from sfm_front.evaluation.live.benchmark import run_live
from sfm_front.evaluation.live.timeline import LivePhoto, Timeline
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.reconstruction.scenes import find_scene
from sfm_front.photos.source import list_photos
from sfm_front.reports.run_summary import Latency
from sfm_front.session.options import SessionOptions, available_cores
from sfm_front.storage.json_files import write_json

_RECONSTRUCT = Path(__file__).resolve().with_name("reconstruct.py")
_NUM_SLOWEST = 5


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="photos, or a scene with its photos in images/")
    parser.add_argument(
        "--interval",
        type=float,
        default=0.6,
        metavar="SECONDS",
        help="from one photo to the next (default: %(default)s)",
    )
    parser.add_argument("--threads", type=int, metavar="N", help="(default: all cores)")
    parser.add_argument(
        "--max-image-size",
        type=int,
        default=SessionOptions().max_image_size,
        metavar="PX",
        help="(default: %(default)s)",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every photo's figures")
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    photos = list_photos(find_scene(args.folder).photos)
    threads = available_cores() if args.threads is None else args.threads
    options = {"--threads": threads, "--max-image-size": args.max_image_size}
    command = [sys.executable, str(_RECONSTRUCT)]
    load = [_load()]
    with TemporaryDirectory(prefix="sfm_front_live_") as workspace:
        timeline = run_live(
            [*command, *(str(part) for option in options.items() for part in option)],
            photos,
            Path(workspace),
            args.interval,
        )
    load.append(_load())
    print(format_timeline(timeline))
    print(f"load average before and after: {_or_dash(load[0])}, {_or_dash(load[1])}")
    if args.json:
        content = {"machine": machine(), "threads": threads, "interval_s": args.interval}
        write_json(args.json, {**content, "load": load, **asdict(timeline)})


def format_timeline(timeline: Timeline) -> str:
    placed = [photo for photo in timeline.photos if photo.placed_s is not None]
    added = [photo for photo in timeline.photos if photo.stages]
    lines = [
        f"{len(placed)} of {len(timeline.photos)} photos registered",
        "                        median     95 %    worst",
        _line("copied to placed", (photo.placed_s for photo in placed)),
        _line("arrived to placed", (photo.arrived_to_placed_s for photo in placed)),
        _line("turn alone", (photo.turn_s for photo in added)),
    ]
    for when, while_photos_came in (("while photos came", True), ("afterwards", False)):
        seconds = [
            refinement.seconds
            for refinement in timeline.refinements
            if refinement.while_photos_came == while_photos_came
        ]
        lines.append(
            f"global refinements {when}: {len(seconds)}, {sum(seconds):.2f} s, "
            f"the longest {max(seconds, default=0):.2f} s"
        )
    lines.append("slowest:")
    slowest = sorted(placed, key=lambda photo: -(photo.placed_s or 0))[:_NUM_SLOWEST]
    return "\n".join([*lines, *(_slow(photo) for photo in slowest)])


def _line(what: str, seconds: Iterable[float | None]) -> str:
    latency = Latency.of([value for value in seconds if value is not None])
    if latency is None:
        return f"{what:<20} -"
    return f"{what:<20}{latency.median_s:8.2f} s{latency.p95_s:7.2f} s{latency.worst_s:7.2f} s"


def _slow(photo: LivePhoto) -> str:
    stages = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in photo.stages.items())
    return (
        f"  {photo.name}: {photo.placed_s:.2f} s, "
        f"arrived after {photo.noticed_s or 0:.2f} s; {stages}"
    )


def _load() -> float | None:
    """Of the last minute; None where the system does not tell."""
    try:
        return os.getloadavg()[0]
    except (AttributeError, OSError):
        return None


def _or_dash(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def main() -> int:
    try:
        with unfailing_streams():
            run(parse())
    except SfmFrontError as error:
        print(f"benchmark_live: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
