"""Whether the extra that the page needs is there, and what is made if it is."""

from __future__ import annotations

import re
from importlib import metadata
from pathlib import Path

from sfm_front.errors import DependencyError
from sfm_front.storage.colmap_models import find_models

_OLDEST = (1, 1)


def is_installed() -> bool:
    """Whether viser is, and is new enough."""
    try:
        numbers = re.findall(r"\d+", metadata.version("viser"))
    except metadata.PackageNotFoundError:
        return False
    return tuple(map(int, numbers[:2])) >= _OLDEST


def check_installed() -> None:
    """Raises DependencyError, in one line, if it is not."""
    if not is_installed():
        raise DependencyError("the live page needs viser 1.1: pip install 'sfm-front[live]'")


def scene_if_possible(output: Path) -> Path | None:
    """Write ``scene.html`` into an output; None without the extra, or without a model to show."""
    if not is_installed() or not find_models(output / "sparse"):
        return None
    from sfm_front.live_page.scene_file import write_scene

    return write_scene(output)
