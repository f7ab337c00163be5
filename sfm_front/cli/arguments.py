"""Command-line arguments that several commands have."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from sfm_front.cli.terminal import printable

if TYPE_CHECKING:
    from sfm_front.retrieval.retriever import RetrievalOptions


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong without all options before it, among which it would be lost."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, printable(f"{self.prog}: {message}; see {self.prog} --help") + "\n")

    def parse_known_args(self, args=None, namespace=None):  # type: ignore[no-untyped-def]
        """As ever, but what a command does not know is an error of its own, with its help."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown


def add_photos(group: argparse._ActionsContainer) -> None:
    """Declare how photos are read."""
    group.add_argument(
        "--max-image-size", type=int, metavar="PX", help="long side to reduce to (default: 1600)"
    )
    group.add_argument(
        "--max-features", type=int, metavar="N", help="SIFT keypoints per photo (default: 4000)"
    )


def add_retrieval(group: argparse._ActionsContainer) -> None:
    """Declare how photos are retrieved."""
    group.add_argument(
        "--global-descriptor",
        metavar="NAME",
        help="vlad, resnet101_pool5, alexnet_fc7, mobilenet_v2, two joined by + (VLAD weighs "
        "0.8, the network 0.2, measured with mobilenet_v2 only), or auto (default)",
    )
    group.add_argument("--weights", type=Path, metavar="FILE", help="of the network")
    group.add_argument("--candidates", type=int, metavar="N", help="photos re-ranked (default: 25)")


def add_machine(group: argparse._ActionsContainer) -> None:
    """Declare what of the machine is used."""
    group.add_argument(
        "--device",
        help="of networks and matching: auto (default), cpu or cuda; auto means a GPU if usable",
    )
    group.add_argument("--threads", type=int, metavar="N", help="cores to use (default: all)")


def given(
    arguments: argparse.Namespace, retrieval: RetrievalOptions | None = None
) -> dict[str, Any]:
    """Fields of ``SessionOptions`` for those of these arguments that were given.

    ``retrieval``: what it is before; it keeps what has no argument.
    """
    from sfm_front.retrieval.retriever import RetrievalOptions

    names = ("max_image_size", "max_features", "global_descriptor", "weights", "device", "threads")
    fields = {name: value for name in names if (value := getattr(arguments, name)) is not None}
    if arguments.candidates is not None:
        fields["retrieval"] = replace(
            retrieval or RetrievalOptions(), candidates=arguments.candidates
        )
    return fields
