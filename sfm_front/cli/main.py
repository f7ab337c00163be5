"""The command line: ``sfm-front COMMAND``; the scripts call the same."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Sequence

from sfm_front import __version__
from sfm_front.cli import explain, export, guide, reconstruct, report, retrieve, view
from sfm_front.cli.arguments import OneLineParser
from sfm_front.cli.completion import add_completion
from sfm_front.cli.logs import add_logging, logging_to
from sfm_front.cli.signals import INTERRUPTED
from sfm_front.cli.streams import unfailing_streams
from sfm_front.cli.terminal import printable_line
from sfm_front.errors import SfmFrontError


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the exit status. Mistakes of the user end in one line and status 2."""
    with unfailing_streams() as why_incomplete:
        given = sys.argv[1:] if argv is None else argv
        arguments = make_parser().parse_args(given)
        arguments.given = given
        status = _run(arguments)
        lost = why_incomplete()
        if lost is not None:
            print(f"sfm-front: standard output is incomplete ({lost.strerror})", file=sys.stderr)
            # What a reconstruction makes is in its folder; the others answer on standard output.
            if arguments.command != "reconstruct":
                status = status or 1
    return status


def make_parser() -> argparse.ArgumentParser:
    """That of all commands."""
    parser = OneLineParser(
        prog="sfm-front", description="Structure-from-Motion that keeps up with the camera."
    )
    parser.add_argument("--version", action="version", version=__version__)
    add_completion(parser)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add(commands, "reconstruct", "folder of photos → sparse models", reconstruct)
    _add(commands, "retrieve", "folder and photo → its most relevant photos", retrieve)
    _add(commands, "view", "look at a sparse model", view)
    _add(commands, "export", "hand a model on to another tool", export)
    _add(commands, "report", "the page of a reconstruction, made anew", report)
    _add(commands, "explain", "why a photo was placed, or was not", explain)
    _add(commands, "guide", "read a guide that ships with the package", guide)
    return parser


def _run(arguments: argparse.Namespace) -> int:
    run: Callable[[argparse.Namespace], int] = arguments.run
    # Pillow warns of damaged EXIF, line by line between the progress lines.
    warnings.filterwarnings("ignore", module=r"PIL\.")
    try:
        with logging_to(arguments.verbose, arguments.log_file):
            return run(arguments)
    except SfmFrontError as error:
        print(printable_line(f"sfm-front {arguments.command}: {error}"), file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return INTERRUPTED


def _add(
    commands: argparse._SubParsersAction[OneLineParser],
    name: str,
    summary: str,
    command: object,
) -> None:
    parser = commands.add_parser(name, help=summary, description=command.__doc__)
    command.add_arguments(parser)  # type: ignore[attr-defined]
    add_logging(parser)
    parser.set_defaults(run=command.run)  # type: ignore[attr-defined]
