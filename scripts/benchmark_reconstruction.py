"""Compare our reconstruction with pycolmap's pipelines on the same photos, in one run.

A FOLDER holds photos, or has them in its images/. Ground truth is looked for in its gt/.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.cli.streams import unfailing_streams
from sfm_front.errors import ConfigError, InputError, SfmFrontError
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.reconstruction.benchmark import OURS, Row, benchmark_scene
from sfm_front.evaluation.reconstruction.chart import check_matplotlib, write_chart
from sfm_front.evaluation.reconstruction.rivals import RIVALS
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene, find_scene
from sfm_front.evaluation.reconstruction.table import format_profile, format_table
from sfm_front.evaluation.reconstruction.types import CAMERA_MODES, BenchmarkSettings
from sfm_front.session.options import available_cores
from sfm_front.storage.json_files import write_json

RECONSTRUCT = [sys.executable, str(Path(__file__).resolve().parent / "reconstruct.py")]


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="Rivals match: " + "; ".join(f"{name}: {how}" for name, how in RIVALS.items()) + ".",
    )
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--gt", type=Path, metavar="MODEL", help="true poses of a single FOLDER")
    parser.add_argument(
        "--rivals",
        default=",".join(RIVALS),
        metavar="NAMES",
        help="separated by commas (default: %(default)s)",
    )
    parser.add_argument("--runs", type=int, default=1, metavar="N", help="(default: 1)")
    parser.add_argument("--max-image-size", type=int, default=1600, metavar="PX")
    parser.add_argument("--max-features", type=int, default=4000, metavar="N")
    parser.add_argument("--threads", type=int, metavar="N", help="(default: all cores)")
    parser.add_argument("--camera-mode", choices=CAMERA_MODES, default="auto")
    parser.add_argument(
        "--order",
        choices=("name", "time", "random"),
        default="name",
        help="in which ours takes the photos; the rivals get them all at once",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the first run; later ones add 1")
    parser.add_argument("--profile", action="store_true", help="print seconds by stage of ours")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every run's figures")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="write a bar chart")
    parser.add_argument(
        "--keep", type=Path, metavar="DIR", help="keep databases, models and logs in this folder"
    )
    return parser.parse_args(argv)


def run(args: argparse.Namespace) -> None:
    settings = BenchmarkSettings(
        threads=available_cores() if args.threads is None else args.threads,
        max_image_size_px=args.max_image_size,
        max_features=args.max_features,
        camera_mode=args.camera_mode,
        order=args.order,
        seed=args.seed,
    )
    rivals = [name for name in args.rivals.split(",") if name]
    scenes = [find_scene(folder, args.gt) for folder in args.folders]
    check(args, rivals, scenes)
    rows: list[Row] = []
    with TemporaryDirectory(prefix="sfm_front_benchmark_") as scratch:
        for scene in scenes:
            rows += benchmark_scene(
                scene,
                rivals,
                settings,
                ours=RECONSTRUCT,
                runs=args.runs,
                workspace=args.keep or Path(scratch),
                keep=args.keep is not None,
                note=lambda line: print(line, file=sys.stderr, flush=True),
            )
    print(format_table(rows))
    if args.profile:
        for row in rows:
            if row.method == OURS:
                print("\n" + format_profile(row))
    if args.json:
        content = {
            "settings": asdict(settings),
            "machine": machine(),
            "rows": [row.as_dict() for row in rows],
        }
        write_json(args.json, content)
    if args.figure:
        write_chart(rows, args.figure)


def check(args: argparse.Namespace, rivals: list[str], scenes: list[BenchmarkScene]) -> None:
    """Refuse before the first run what would otherwise fail after the last."""
    unknown = [name for name in rivals if name not in RIVALS]
    if unknown:
        raise ConfigError(f"--rivals: {', '.join(unknown)} unknown; there are {', '.join(RIVALS)}")
    if args.runs < 1:
        raise ConfigError(f"--runs must be at least 1, got {args.runs}")
    if args.gt and len(scenes) > 1:
        raise ConfigError("--gt goes with one FOLDER; put each scene's model into its gt/ instead")
    names = [scene.name for scene in scenes]
    if len(set(names)) < len(names):
        raise ConfigError(f"two FOLDERs have the same name ({', '.join(names)}); rename one")
    if args.keep and args.keep.exists() and any(args.keep.iterdir()):
        raise InputError(f"{args.keep}: not empty; give a new folder to --keep")
    if args.figure:
        check_matplotlib()


def main() -> int:
    try:
        with unfailing_streams():
            run(parse())
    except SfmFrontError as error:
        print(f"benchmark_reconstruction: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
