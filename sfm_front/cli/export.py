"""Hand a model on to another tool, with its photos as that tool needs them.

Writes a folder, whole or not at all, and never over anything. What the target cannot hold is
refused. The folder's README.txt has the next command.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from dataclasses import asdict
from pathlib import Path

from sfm_front.cli.progress import CountLine
from sfm_front.cli.signals import leaving_at_signal
from sfm_front.cli.terminal import printable
from sfm_front.exporters.registry import TARGETS, export
from sfm_front.reports.words import one_line

_EXIT_STATUS = """\
exit status: 0 the folder was written, 2 a mistake in what was given, 130 stopped, and nothing is
left behind. A second Ctrl-C, SIGTERM or SIGHUP leaves at once, and what was begun stays.
"""
_STOPPING = "stopping; once more leaves at once"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``export`` on ``parser``."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    width = max(map(len, TARGETS))
    targets = (f"  {name:<{width}}  {target.summary}\n" for name, target in TARGETS.items())
    parser.epilog = f"targets:\n{''.join(targets)}\n{_EXIT_STATUS}"
    parser.add_argument(
        "source",
        type=Path,
        metavar="OUTPUT|MODEL",
        help="output of a reconstruction, or folder of one COLMAP model",
    )
    parser.add_argument("--to", required=True, choices=TARGETS, metavar="TARGET", help="see below")
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help="where to write (default: OUTPUT/export/TARGET)"
    )
    parser.add_argument(
        "--model", type=int, metavar="N", help="model to export (default: the largest)"
    )
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    photos = parser.add_argument_group("photos")
    photos.add_argument(
        "--images",
        type=Path,
        metavar="FOLDER",
        help="where they are, if they are no longer where they were",
    )
    photos.add_argument(
        "--max-size", type=int, metavar="PX", help="long side to reduce larger ones to"
    )
    kept = photos.add_mutually_exclusive_group()
    kept.add_argument(
        "--copy",
        action="store_true",
        help="copy those that stay as they are, so that the folder stands on its own (default)",
    )
    kept.add_argument("--link", action="store_true", help="link to them instead")
    photos.add_argument(
        "--threads", type=int, metavar="N", help="worked on at a time (default: all cores)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Export; 0 if the folder was written."""
    import pycolmap

    from sfm_front.exporters.options import ExportOptions
    from sfm_front.session.options import available_cores

    pycolmap.logging.minloglevel = pycolmap.logging.Level.FATAL.value
    threads = available_cores() if arguments.threads is None else arguments.threads
    options = ExportOptions(max_size_px=arguments.max_size, link=arguments.link, threads=threads)
    progress = CountLine("photo", sys.stderr, quiet=arguments.quiet)
    with leaving_at_signal(2, _STOPPING) as interrupted:

        def show(done: int, total: int) -> None:
            if interrupted():
                raise KeyboardInterrupt
            progress.show(done, total)

        try:
            exported = export(
                arguments.source,
                arguments.to,
                output=arguments.output,
                number=arguments.model,
                images=arguments.images,
                options=options,
                on_progress=show,
            )
        finally:
            progress.end()
    next_step = exported.next_step.format(folder=shlex.quote(str(exported.folder)))
    if arguments.json:
        from sfm_front.storage.json_files import as_json

        print(as_json({**asdict(exported), "next_step": next_step}))
        return 0
    lines = [f"{exported.folder}: {exported.num_photos} photos, {exported.num_points} points"]
    if not arguments.quiet:
        lines += [*exported.notes, f"next: {next_step}"]
    print(printable("\n".join(map(one_line, lines))))
    return 0
