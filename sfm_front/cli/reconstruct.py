"""Reconstruct a folder of photos, one image at a time.

Each photo is retrieved against those before it, its verified matches go into a COLMAP database,
and it is placed in a model before the next one is taken.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from sfm_front.cli import arguments as shared
from sfm_front.cli.progress import ProgressLine
from sfm_front.errors import ConfigError, InputError
from sfm_front.photos.source import list_photos, order_photos
from sfm_front.reports.summary import closing_summary

if TYPE_CHECKING:
    from sfm_front.session.options import SessionOptions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``reconstruct``. Defaults left out here are the session's."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.set_defaults(usage_error=parser.error)
    parser.add_argument("folder", type=Path, nargs="?", help="photos, sub-folders included")
    parser.add_argument(
        "--output",
        type=_folder,
        help="where to write (default: outputs/NAME, by the folder's name, or by its parent's "
        "if it is called images)",
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace a reconstruction that is there"
    )
    parser.add_argument(
        "--text",
        action=argparse.BooleanOptionalAction,
        help="whether to write models as text too; photo names must not hold spaces then",
    )
    parser.add_argument(
        "--config", type=Path, metavar="FILE", help="TOML of options; flags given here win over it"
    )
    parser.add_argument(
        "--print-config",
        action="store_true",
        help="print all options as such a file, and do nothing else",
    )
    photos = parser.add_argument_group("photos")
    photos.add_argument(
        "--order", default="name", help="name, time of capture, or random (default: name)"
    )
    photos.add_argument(
        "--seed",
        type=int,
        help="of --order random and of all RANSAC (default: 0)",
    )
    shared.add_photos(photos)
    cameras = parser.add_argument_group("cameras")
    cameras.add_argument(
        "--camera-mode",
        help="which photos share one: auto (default), single, per-folder or per-image",
    )
    cameras.add_argument("--camera-model", help="any of COLMAP's (default: SIMPLE_RADIAL)")
    cameras.add_argument(
        "--camera-params", metavar="F,CX,CY,…", help="known calibration, in COLMAP's order"
    )
    retrieval = parser.add_argument_group("retrieval")
    shared.add_retrieval(retrieval)
    retrieval.add_argument(
        "--num-matched",
        "--matched",
        type=int,
        metavar="N",
        help="best of them matched on all features (default: 8)",
    )
    shared.add_machine(parser)


def run(arguments: argparse.Namespace) -> int:
    """Reconstruct, or print the options; 1 if no model could be built, else 0."""
    if arguments.print_config:
        from sfm_front.cli.config_file import as_toml

        print(as_toml(session_options(arguments)), end="")
        return 0
    if arguments.folder is None:
        arguments.usage_error("the following arguments are required: folder")
    folder: Path = arguments.folder
    output: Path = arguments.output or default_output(folder)
    listed = list_photos(folder, exclude=output)
    options = session_options(arguments)
    photos = order_photos(listed, arguments.order, seed=options.seed)

    import pycolmap

    from sfm_front.exporters.colmap import first_name_lost_in_text
    from sfm_front.session.session import Session

    if options.text and (lost := first_name_lost_in_text(photo.name for photo in listed)):
        raise InputError(
            f"{lost!r}: COLMAP's text format would cut this name at its white space. "
            "Rename the photo, or leave --text out."
        )
    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value
    progress = ProgressLine(len(photos), sys.stdout)
    with (
        Session(output, options, overwrite=arguments.overwrite, on_event=progress.show) as session,
        _interruptible() as interrupted,
    ):
        for message in session.messages:
            progress.note(message)
        for _ in session.add_all(photos):
            if interrupted():
                progress.note("stopping: finishing with the photos taken so far")
                break
        progress.finishing()
        result = session.finish()
        progress.end()
        print(closing_summary(result.summary, output))
    return 0 if result.models else 1


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("give a folder, or leave --output out")
    return Path(text)


def default_output(folder: Path) -> Path:
    """``outputs/NAME`` below the working folder."""
    try:
        resolved = folder.resolve()
    except (OSError, RuntimeError):  # Links in a circle, no working folder: listing will say so.
        resolved = folder
    named = resolved.parent if resolved.name.lower() == "images" else resolved
    return Path("outputs") / (named.name or "photos")


def session_options(arguments: argparse.Namespace) -> SessionOptions:
    """What was given on the command line; the rest is of ``--config``, or the default."""
    from sfm_front.cli.config_file import read_options
    from sfm_front.session.options import SessionOptions

    base = SessionOptions() if arguments.config is None else read_options(arguments.config)
    given = shared.given(arguments, base.retrieval)
    if arguments.num_matched is not None:
        given["pair_matching"] = replace(base.pair_matching, num_matched=arguments.num_matched)
    if arguments.text is not None:
        given["text"] = arguments.text
    if arguments.seed is not None:
        given["seed"] = arguments.seed
    cameras = {
        "mode": arguments.camera_mode,
        "model": arguments.camera_model,
        "params": _numbers(arguments.camera_params),
    }
    given["cameras"] = replace(
        base.cameras, **{name: value for name, value in cameras.items() if value is not None}
    )
    return replace(base, **given)


def _numbers(text: str | None) -> tuple[float, ...] | None:
    if text is None:
        return None
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(
            f"--camera-params takes numbers separated by commas, got {text!r}"
        ) from None


@contextmanager
def _interruptible() -> Iterator[Callable[[], bool]]:
    """Let the first Ctrl-C ask the loop to stop between two photos; the second one interrupts."""
    asked = False

    def ask(_number: int, _frame: FrameType | None) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield lambda: asked
    finally:
        signal.signal(signal.SIGINT, before)
