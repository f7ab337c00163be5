"""The result of a reconstruction, told in words or as JSON."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from sfm_front.cli.terminal import painted, printable
from sfm_front.reports import html
from sfm_front.reports.summary import closing_summary

if TYPE_CHECKING:
    from sfm_front.reports.run_summary import RunSummary


def tell_result(
    arguments: argparse.Namespace, summary: RunSummary, output: Path, spoken: TextIO
) -> None:
    """In words to ``spoken``, of which the first line is all that matters, or as JSON."""
    from sfm_front.reports.verdict import verdict

    if arguments.json:
        _print_json(summary, output)
    if arguments.json and arguments.quiet:
        return
    first, *details = closing_summary(
        summary, output, watched=arguments.watch, with_stages=arguments.verbose > 0
    ).split("\n")
    level = verdict(summary, summary.sidecar).level
    print(painted(printable(first), level, spoken), file=spoken)
    if not arguments.quiet:
        for line in (*details, *_next_steps(summary, output)):
            print(printable(line), file=spoken)


def tell_nothing_to_do(arguments: argparse.Namespace, output: Path) -> None:
    """Of a session that is finished already; as JSON, its result."""
    from sfm_front.reports.report_json import read_report

    if arguments.json:
        _print_json(read_report(output), output)
    else:
        folder = arguments.folder
        print(printable(f"{output}: finished, and holds all photos of {folder}: nothing to do"))


def _next_steps(summary: RunSummary, output: Path) -> list[str]:
    """What to do with the result, to be copied."""
    lines = [f"to look at: {output / html.FILE}"]
    if (output / html.SCENE_FILE).is_file():
        lines.append(f"            {output / html.SCENE_FILE}")
    if summary.models:
        folder = shlex.quote(str(output))
        lines += [
            f"            sfm-front view {folder}",
            f"for other tools: sfm-front export {folder} --to nerfstudio",
        ]
    return lines


def _print_json(summary: RunSummary, output: Path) -> None:
    from sfm_front.reports.result_json import result
    from sfm_front.storage.json_files import as_json

    print(as_json(result(summary, output)))
