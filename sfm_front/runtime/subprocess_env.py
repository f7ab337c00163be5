"""The environment for a process that runs a module of this package."""

from __future__ import annotations

import os
from pathlib import Path

import sfm_front


def module_environment() -> dict[str, str]:
    """This process's environment, in which ``python -m sfm_front...`` also works uninstalled."""
    environment = dict(os.environ)
    package_root = str(Path(sfm_front.__file__).resolve().parents[1])
    search = [package_root, *filter(None, [environment.get("PYTHONPATH")])]
    environment["PYTHONPATH"] = os.pathsep.join(search)
    return environment
