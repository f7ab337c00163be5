"""The command that goes on with a run."""

from __future__ import annotations

import shlex
from collections.abc import Sequence


def command_again(given: Sequence[str]) -> str:
    """As it was given to ``sfm-front``, ready for a shell; without ``--overwrite``, which would
    begin anew."""
    return shlex.join(["sfm-front", *(part for part in given if not _overwrites(part))])


def _overwrites(part: str) -> bool:
    return part.startswith("--ov") and "--overwrite".startswith(part)
