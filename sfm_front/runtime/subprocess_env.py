"""What a process that runs a module of this package needs."""

from __future__ import annotations

import os
from pathlib import Path

_PACKAGE_ROOT = Path(__file__).resolve().parents[2]


def module_environment() -> dict[str, str]:
    """This environment, in which ``python -m sfm_front...`` finds the package, installed or not."""
    environment = dict(os.environ)
    search = [str(_PACKAGE_ROOT), *filter(None, [environment.get("PYTHONPATH")])]
    environment["PYTHONPATH"] = os.pathsep.join(search)
    return environment
