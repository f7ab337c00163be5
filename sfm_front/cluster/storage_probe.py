"""Whether workers see the files that the coordinator sees."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sfm_front.cluster.connection import Cluster


def read_text(path: str) -> str:
    """On a worker: the file, or nothing."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ""


def size_of(path: str) -> int:
    """On a worker: bytes of the file; -1 if it is not there."""
    try:
        return Path(path).stat().st_size
    except OSError:
        return -1


def all_see_token(cluster: Cluster, token: Path, content: str) -> bool:
    """Whether every worker reads this in this file."""
    return _all(cluster, read_text, token, content)


def all_see_photo(cluster: Cluster, photo: Path) -> bool:
    """Whether every worker finds a file of its size there."""
    return _all(cluster, size_of, photo.absolute(), size_of(str(photo)))


def _all(cluster: Cluster, ask: Callable[[str], object], path: Path, wanted: object) -> bool:
    answers = cluster.client.run(ask, str(path), on_error="return")
    return all(answer == wanted for answer in answers.values())
