"""Show a sparse model in a window or in a browser, or save a picture of it.

In a browser a session is followed while it runs, also one of another process.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from sfm_front import viewers
from sfm_front.viewers.options import BACKGROUNDS, DrawOptions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``view`` on ``parser``."""
    defaults = DrawOptions()
    parser.add_argument(
        "model",
        type=Path,
        help="folder with a COLMAP model, binary or text; with --web also the output of a session",
    )
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
        "--point-size", type=float, metavar="PX", help="in pixels (default: follows the scene)"
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

        serve(args.model, lambda line: print(line, flush=True))
        return 0
    options = DrawOptions(
        width=args.size[0],
        height=args.size[1],
        point_size_px=args.point_size,
        background=args.background,
    )
    if args.screenshot is None:
        viewers.view(args.model, options)
        return 0
    viewers.screenshot(args.model, args.screenshot, options)
    print(f"wrote {args.screenshot}")
    return 0


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)[xX×](\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"expected WxH such as 1600x1000, got {text}")
    return int(match[1]), int(match[2])
