"""JSON that people can read too: one indented line per value, letters unescaped."""

from __future__ import annotations

import json
import os
from pathlib import Path

from sfm_front.storage.atomic import write_atomically


def as_json(content: object) -> str:
    """JSON text; paths become strings. Raises TypeError for what is neither JSON nor a path."""
    return json.dumps(content, ensure_ascii=False, indent=1, default=os.fspath)


def write_json(path: Path, content: object) -> None:
    """Write a file in UTF-8, whole or not at all; folders are created.

    Raises InputError if it cannot be written.
    """
    # File names may hold bytes that are not UTF-8; Python's escape for them is valid JSON.
    data = f"{as_json(content)}\n".encode(errors="backslashreplace")
    write_atomically(path, lambda file: file.write(data))
