"""Make the page of a reconstruction anew: verdict, pictures, plan, accuracy, reasons, times.

Of one that still runs, or was stopped, it shows how far that is.
"""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``report`` on ``parser``."""
    parser.add_argument("output", type=Path, help="output of a reconstruction, also while it runs")
    parser.add_argument(
        "--photos",
        type=Path,
        metavar="FOLDER",
        help="where the photos are, if they are no longer where they were",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write ``report.html`` into the output; 0 if it was written."""
    from sfm_front.live_page.files import write_files
    from sfm_front.reports.report_json import read_report
    from sfm_front.reports.standing import read_story

    if not read_story(arguments.output).is_unfinished:
        read_report(arguments.output)  # Where no session has been, nothing is made.
    file, scene = write_files(arguments.output, arguments.photos)
    print(file if arguments.quiet else f"wrote {file}: open it in a browser")
    if scene is not None and not arguments.quiet:
        print(f"wrote {scene}: the models to turn in a browser")
    return 0
