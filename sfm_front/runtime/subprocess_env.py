"""What a process that runs a module of this package needs."""

from __future__ import annotations

import os
from pathlib import Path

import sfm_front


def module_environment() -> dict[str, str]:
    """This environment, in which ``python -m sfm_front...`` finds the package, installed or not."""
    environment = dict(os.environ)
    package_root = str(Path(sfm_front.__file__).resolve().parents[1])
    search = [package_root, *filter(None, [environment.get("PYTHONPATH")])]
    environment["PYTHONPATH"] = os.pathsep.join(search)
    return environment
