"""What the package logs, on the screen and in a file."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sfm_front.errors import InputError

_LEVELS = (logging.WARNING, logging.INFO, logging.DEBUG)


def add_logging(parser: argparse.ArgumentParser) -> None:
    """Declare how much is told, and where."""
    how_much = parser.add_mutually_exclusive_group()
    how_much.add_argument(
        "-v",
        "--verbose",
        action="count",
        default=0,
        help="tell more; twice: a line for each pair of photos",
    )
    how_much.add_argument(
        "-q", "--quiet", action="store_true", help="tell only mistakes and the result"
    )
    parser.add_argument(
        "--log-file", type=Path, metavar="FILE", help="write everything that -vv would tell to FILE"
    )


@contextmanager
def logging_to(verbosity: int, file: Path | None) -> Iterator[None]:
    """Log to standard error by ``verbosity`` (0 to 2), and all to ``file``, which is added to.

    Raises InputError if the file cannot be written.
    """
    package = logging.getLogger("sfm_front")
    screen = logging.StreamHandler(sys.stderr)
    screen.setLevel(_LEVELS[min(verbosity, len(_LEVELS) - 1)])
    screen.setFormatter(logging.Formatter("%(message)s"))
    handlers: list[logging.Handler] = [screen]
    if file is not None:
        try:
            written = logging.FileHandler(file, encoding="utf-8", errors="backslashreplace")
        except OSError as error:
            raise InputError(
                f"{file}: cannot be written ({error.strerror}). Give another --log-file."
            ) from error
        written.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
        handlers.append(written)
    level = package.level
    package.setLevel(logging.DEBUG if file is not None else screen.level)
    for handler in handlers:
        package.addHandler(handler)
    try:
        yield
    finally:
        package.setLevel(level)
        for handler in handlers:
            package.removeHandler(handler)
            handler.close()
