"""JSON for people to read, too: an indented line a value, letters as they are."""

from __future__ import annotations

import json
import os
from pathlib import Path

from sfm_front.storage.atomic import write_atomically


def as_json(content: object) -> str:
    """Paths are written as their text. Raises TypeError for what is neither JSON nor a path."""
    return json.dumps(content, ensure_ascii=False, indent=1, default=os.fspath)


def write_json(path: Path, content: object) -> None:
    """Write a file in UTF-8, whole or not at all; folders are made.

    Raises InputError where it cannot be written.
    """
    # A file's name may hold bytes that are no UTF-8; JSON has the same escape for them as Python.
    data = f"{as_json(content)}\n".encode(errors="backslashreplace")
    write_atomically(path, lambda file: file.write(data))
