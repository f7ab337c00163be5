"""Show sparse models in a window, or save a picture of them.

Of an output with several models all are shown: in their place where they are georeferenced, else
side by side. Up is up: in east, north and up, or as the cameras tell. With --web, a page in the
browser follows a session while it runs, also one of another process.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sfm_front import viewers
from sfm_front.cli.signals import CLOSING, leaving_at_signal
from sfm_front.errors import InputError
from sfm_front.storage.colmap_models import is_model
from sfm_front.viewers.options import BACKGROUNDS, DrawOptions
from sfm_front.viewers.point_colors import COLORINGS

if TYPE_CHECKING:
    from sfm_front.types import Float64Array


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``view`` on ``parser``."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    defaults = DrawOptions()
    width = max(map(len, COLORINGS))
    colorings = "".join(f"  {name:<{width}}  {says}\n" for name, says in COLORINGS.items())
    parser.epilog = f"colours of points:\n{colorings}"
    parser.add_argument(
        "model",
        type=Path,
        metavar="OUTPUT|MODEL",
        help="output of a reconstruction, or folder with a COLMAP model, binary or text",
    )
    parser.add_argument("--model", type=int, metavar="N", dest="number", help="only sparse/N of it")
    parser.add_argument(
        "--web",
        action="store_true",
        help="a page for browsers on this machine, which follows a session that runs",
    )
    parser.add_argument(
        "--screenshot", type=Path, metavar="FILE.png", help="write a picture, without a screen"
    )
    parser.add_argument(
        "--size",
        type=_size,
        default=(defaults.width, defaults.height),
        metavar="WxH",
        help=f"of the window or picture, in pixels (default {defaults.width}x{defaults.height})",
    )
    parser.add_argument(
        "--color-by",
        choices=tuple(COLORINGS),
        default=defaults.coloring,
        help="what the colours of points say, see below (default %(default)s)",
    )
    parser.add_argument(
        "--point-size", type=float, metavar="PX", help="in pixels (default: follows the scene)"
    )
    parser.add_argument(
        "--frusta",
        action=argparse.BooleanOptionalAction,
        default=defaults.frusta,
        help="whether cameras are drawn",
    )
    parser.add_argument(
        "--path", action="store_true", help="draw a line from each camera to the next"
    )
    parser.add_argument(
        "--background",
        choices=tuple(BACKGROUNDS),
        default=defaults.background,
        help="(default %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Do what ``add_arguments`` parsed; the exit status."""
    if args.web:
        from sfm_front.live_page.viewing import serve

        with leaving_at_signal(2, CLOSING) as interrupted:
            serve(args.model, lambda line: print(line, flush=True), interrupted)
        return 0
    options = DrawOptions(
        width=args.size[0],
        height=args.size[1],
        point_size_px=args.point_size,
        background=args.background,
        coloring=args.color_by,
        frusta=args.frusta,
        path=args.path,
    )
    models = _models(args.model, args.number)
    if args.screenshot is None:
        viewers.view(models, options, _common_up(models))
        return 0
    for legend in viewers.screenshot(models, args.screenshot, options, _common_up(models)):
        print(legend)
    print(f"wrote {args.screenshot}")
    return 0


def _models(place: Path, number: int | None) -> Sequence[Path]:
    """The models at a place, or the one of a number; the place itself where there is none, of
    which reading will say what is wrong."""
    if is_model(place):
        if number is not None:
            raise InputError(f"{place} is one model: leave --model out, or give the output")
        return [place]
    sparse = place / "sparse"
    found = [path for path in sparse.iterdir() if is_model(path)] if sparse.is_dir() else []
    # As they are written, the largest first.
    found.sort(key=lambda path: (len(path.name), path.name))
    if number is None:
        return found or [place]
    picked = [path for path in found if path.name == str(number)]
    if not picked:
        names = ", ".join(path.name for path in found) or "none"
        raise InputError(f"{place}: no model {number} in its sparse/, which has {names}")
    return picked


def _common_up(models: Sequence[Path]) -> Float64Array | None:
    """That of east, north and up if all models are in it."""
    from sfm_front.georeference.sidecar import FILE_NAME, read_sidecar
    from sfm_front.viewers.side_by_side import UP

    file = models[0].parent / FILE_NAME
    if not file.is_file():
        return None
    in_enu = {str(number) for number in read_sidecar(file).models_in_enu}
    return UP if {model.name for model in models} <= in_enu else None


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)[xX×](\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"expected WxH such as 1600x1000, got {text}")
    return int(match[1]), int(match[2])
