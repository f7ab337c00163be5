"""The command line: arguments in, calls to the library, words out."""

from __future__ import annotations

from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run ``sfm-front`` as a process of its own; see ``sfm_front.cli.main``."""
    from sfm_front.cli.signals import leaving_at_signal

    # Before all other imports: Ctrl-C in the middle of one raises what nobody can foresee.
    with leaving_at_signal(1):
        from sfm_front.cli.main import main as run

        return run(argv)
