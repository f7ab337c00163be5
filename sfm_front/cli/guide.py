"""Read a guide: commands to copy, what to expect, what to do when it goes wrong.

They ship with the package, and need no network.
"""

from __future__ import annotations

import argparse
import pydoc
from importlib.resources import files


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``guide`` on ``parser``."""
    parser.add_argument(
        "name",
        nargs="?",
        choices=list(read_guides()),
        metavar="NAME",
        help=f"one of {', '.join(read_guides())}; without it, all are listed",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the guide, a page at a time on a terminal, or the list of all."""
    guides = read_guides()
    if arguments.name is None:
        width = max(map(len, guides))
        for name, text in guides.items():
            print(f"{name:<{width}}  {title(text)}")
        return 0
    # It prints where standard output is no terminal.
    pydoc.pager(guides[arguments.name])
    return 0


def read_guides() -> dict[str, str]:
    """Markdown by name, in order of the alphabet."""
    found = {
        file.name.removesuffix(".md"): file.read_text(encoding="utf-8")
        for file in files("sfm_front").joinpath("guides").iterdir()
        if file.name.endswith(".md")
    }
    return dict(sorted(found.items()))


def title(text: str) -> str:
    """The first heading."""
    return text.splitlines()[0].removeprefix("# ")
