"""The environment for a process that runs a module of this package."""

from __future__ import annotations

import os
from pathlib import Path

_PACKAGE_ROOT = Path(__file__).resolve().parents[2]


def module_environment() -> dict[str, str]:
    """This process's environment, in which ``python -m sfm_front...`` also works uninstalled."""
    environment = dict(os.environ)
    search = [str(_PACKAGE_ROOT), *filter(None, [environment.get("PYTHONPATH")])]
    environment["PYTHONPATH"] = os.pathsep.join(search)
    return environment
