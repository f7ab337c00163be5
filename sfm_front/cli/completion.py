"""Completion of commands, options and their values by the shell: ``--print-completion``."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

SHELLS = ("bash", "zsh", "fish")
# How arguments that are folders are called; other paths are files.
_FOLDERS = {"DIR", "FOLDER", "OUTPUT|MODEL"}
_FOLDER_NAMES = {"folder", "model", "output", "source"}


def add_completion(parser: argparse.ArgumentParser) -> None:
    """Declare it on the parser of all commands."""
    parser.add_argument(
        "--print-completion",
        choices=SHELLS,
        metavar="SHELL",
        action=_Print,
        help=f"print a script by which {', '.join(SHELLS)} complete commands and options",
    )


class _Print(argparse.Action):
    def __call__(
        self,
        parser: argparse.ArgumentParser,
        _namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        _option_string: str | None = None,
    ) -> None:
        print(completion(parser, str(values)))
        parser.exit()


def completion(parser: argparse.ArgumentParser, shell: str) -> str:
    """The script for one of ``SHELLS``."""
    import shtab

    for action in _actions(parser):
        if action.type is Path or action.dest in _FOLDER_NAMES:
            is_folder = action.dest in _FOLDER_NAMES or action.metavar in _FOLDERS
            action.complete = shtab.DIRECTORY if is_folder else shtab.FILE  # type: ignore[attr-defined]
    return shtab.complete(parser, shell)


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Of all commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
