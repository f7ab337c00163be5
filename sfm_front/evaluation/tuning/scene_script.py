"""What scripts share that try sessions: quiet libraries, errors in a line, figures."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence

from sfm_front.errors import SfmFrontError
from sfm_front.evaluation.machine import machine
from sfm_front.evaluation.tuning.scene_arguments import chosen_settings
from sfm_front.storage.json_files import write_json


def exit_status(
    name: str,
    parse: Callable[[], argparse.Namespace],
    run: Callable[[argparse.Namespace], None],
) -> int:
    """Run a script called ``name``: 0, 2 after a line for a mistake in what was given, 130 after
    one for Ctrl-C."""
    args = parse()

    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value  # a line per failed step
    try:
        run(args)
    except SfmFrontError as error:
        print(f"{name}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{name}: interrupted before it was done", file=sys.stderr)
        return 130
    return 0


def write_figures(
    args: argparse.Namespace, name: str, rows: Sequence[object], **settings: object
) -> None:
    """Write what has been tried so far to ``--json``, if that was given: ``rows``, plain values,
    under ``name``."""
    if args.json:
        content = {
            "settings": chosen_settings(args) | settings,
            "machine": machine(),
            name: list(rows),
        }
        write_json(args.json, content)
