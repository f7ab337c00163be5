"""Read the lines of a file that another process goes on writing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


class EventTail:
    """What has come to a file of JSON lines since the last look."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._identity: tuple[int, int] | None = None
        self._read = 0
        self._begun = b""

    def new(self) -> tuple[list[dict[str, Any]], bool]:
        """New objects, and whether they begin the file anew because it was replaced.

        A line that is not whole yet is left for the next look; what is no JSON object is left out.
        """
        try:
            with self._file.open("rb") as content:
                status = content.seek(0, 2), self._file.stat()
                size, identity = status[0], (status[1].st_dev, status[1].st_ino)
                is_anew = identity != self._identity or size < self._read
                if is_anew:
                    self._identity, self._read, self._begun = identity, 0, b""
                content.seek(self._read)
                data = content.read(size - self._read)
        except OSError:
            return [], False
        self._read += len(data)
        *lines, self._begun = (self._begun + data).split(b"\n")
        return [event for line in lines if (event := _object(line)) is not None], is_anew


def _object(line: bytes) -> dict[str, Any] | None:
    try:
        content = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None
