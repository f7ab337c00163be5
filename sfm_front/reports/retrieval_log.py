"""``retrieval.jsonl``: a line per photo with its candidates, written while photos arrive."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from sfm_front.errors import StorageError
from sfm_front.events import PhotoAdded
from sfm_front.runtime.closeable import Closeable
from sfm_front.storage.atomic import write_atomically
from sfm_front.storage.photo_json import candidate_of_row, candidate_row
from sfm_front.types import CandidateOutcome, StoredPhoto

FILE = "retrieval.jsonl"


class RetrievalLog(Closeable):
    """Writes the file; each line is on disk when ``add`` returns."""

    def __init__(self, output: Path, earlier: Iterable[StoredPhoto] = ()) -> None:
        """The file begins anew, with the lines of ``earlier`` photos."""
        file = output / FILE
        lines = "".join(_line(photo.name, photo.candidates) for photo in earlier)
        write_atomically(file, lambda new: new.write(lines.encode()))
        self._file = file.open("a", encoding="utf-8")

    def add(self, photo: PhotoAdded) -> None:
        """Write a photo's line. Raises StorageError where it cannot be written."""
        try:
            self._file.write(_line(photo.name, photo.candidates))
            self._file.flush()
        except OSError as error:
            raise StorageError(f"{FILE}: cannot be written ({error.strerror}).") from error

    def close(self) -> None:
        # Fails only for a line of which ``add`` has told already.
        with suppress(OSError):
            self._file.close()


def read_candidates(output: Path, name: str) -> tuple[CandidateOutcome, ...]:
    """Candidates of the photo called ``name``, as re-ranked; none if it has no line."""
    with (output / FILE).open(encoding="utf-8") as lines:
        for line in lines:
            content = json.loads(line)
            if content["name"] == name:
                return tuple(candidate_of_row(row) for row in content["candidates"])
    return ()


def _line(name: str, candidates: Sequence[CandidateOutcome]) -> str:
    content = {
        "name": name,
        "most_relevant": candidates[0].name if candidates else None,
        "candidates": [candidate_row(candidate) for candidate in candidates],
    }
    return json.dumps(content, ensure_ascii=False) + "\n"
