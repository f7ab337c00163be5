"""The command line: arguments in, calls to the library, words out."""

from __future__ import annotations

from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run ``sfm-front``; see ``sfm_front.cli.main``."""
    from sfm_front.cli.main import main as run

    return run(argv)
