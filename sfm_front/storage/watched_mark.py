"""Whether somebody looks at an output right now: then its session writes models more often."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

WATCHED = ".sfm_front.watched"

# To be renewed every few seconds; older ones are of a page that is gone.
_FRESH_S = 6.0


def mark_watched(output: Path) -> None:
    """Say so, for the next seconds; without effect in a folder that cannot be written to."""
    with suppress(OSError):
        (output / WATCHED).touch()


def is_watched(output: Path) -> bool:
    """Whether somebody has said so just now."""
    try:
        return time.time() - (output / WATCHED).stat().st_mtime < _FRESH_S
    except OSError:
        return False


def unmark_watched(output: Path) -> None:
    """Nobody looks any more."""
    with suppress(OSError):
        (output / WATCHED).unlink()
