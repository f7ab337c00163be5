"""What coordinator and workers must have in common: the package, to the byte, and pycolmap."""

from __future__ import annotations

import hashlib
import os
import socket
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

from sfm_front.version import VERSION


@lru_cache
def identity() -> str:
    """Such as ``0.1.0 (3fa2b1c0), pycolmap 4.1.1``: code between two releases has one version."""
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.blake2b(digest_size=4)
    for file in sorted(root.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode())
        digest.update(file.read_bytes())
    return f"{VERSION} ({digest.hexdigest()}), pycolmap {version('pycolmap')}"


def worker_name() -> str:
    """Of this process, for people."""
    return f"{socket.gethostname()}:{os.getpid()}"
