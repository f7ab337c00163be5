"""What a session writes beside its models in ``sparse/``, and whether these are whole."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

STATE = "session.json"
"""What a session knows beside its models, in their folder."""


def read_state(sparse: Path) -> dict[str, Any]:
    """The content of ``STATE``; empty if no session wrote the models.

    Raises OSError or ValueError if it cannot be read.
    """
    file = sparse / STATE
    content = json.loads(file.read_bytes()) if file.exists() else {}
    if not isinstance(content, dict):
        raise ValueError(f"{file} is not a session's")
    return content


def damaged_file(folder: Path, sizes: Mapping[str, int]) -> str | None:
    """The first file below ``folder`` whose size is not that in ``sizes``; None if all are whole.

    Asked before pycolmap reads a model: of one cut short it may read for ever.
    """
    return next((name for name, size in sizes.items() if file_size(folder / name) != size), None)


def file_sizes(folder: Path) -> dict[str, int]:
    """Of all binary model files below ``folder``, as ``STATE`` has them for ``damaged_file``."""
    return {
        file.relative_to(folder).as_posix(): file_size(file)
        for file in sorted(folder.rglob("*.bin"))
    }


def file_size(file: Path) -> int:
    """In bytes; 0 if there is no such file."""
    return file.stat().st_size if file.exists() else 0
