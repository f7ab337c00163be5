"""``events.jsonl``: what happens in a session, a line per event, for other programs to follow.

Each line is a JSON object with ``v``, the version of this schema; ``time``, ISO 8601 in UTC;
``event``; and the fields of the dataclass of that event in ``sfm_front.events``:

| event | says |
|---|---|
| ``session_started`` | ``version``, all ``options``, ``num_photos`` there, ``command`` to go on |
| ``photo_arrived`` | the photo was noticed |
| ``photo_skipped`` | ``reason`` and ``detail`` |
| ``photo_described`` | it has its features, and its turn begins; ``seconds`` by stage |
| ``photo_added`` | acknowledged: all its rows are in the database and on the disk |
| ``photo_placed`` | model, ``cam_from_world``, camera, inliers, ``latency_s`` from arrival |
| ``photo_waiting`` | it fits no model yet, and why |
| ``model_started``, ``model_refined``, ``model_dropped`` | what became of a model |
| ``models_joined`` | two became one: by which bridge photos, on how many common points |
| ``look_alikes_refused`` | two groups of photos that were taken for one place |
| ``registered_structure_less`` | photos placed by two-view geometry alone |
| ``looked_again`` | a poorly connected photo was matched with more: ``found`` overlap |
| ``georeferenced`` | how far positions say where a model stands on the earth |
| ``held_to_control_points`` | the finished model, with its ``origin`` and how well it fits |
| ``control_points_refused`` | why they cannot be used; the model is left as it is |
| ``finishing_began`` | no more photos come: a ``step`` of the end begins; ``turn``: for a model |
| ``session_ended`` | ``finished``: whether all models are written; ``num_left``: not taken |

New fields and events leave the version as it is; readers pass over what they do not know.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from datetime import datetime, timezone
from enum import Enum
from pathlib import Path
from typing import IO, Any

from sfm_front.errors import StorageError
from sfm_front.events import (
    ControlPointsRefused,
    Event,
    FinishingBegan,
    Georeferenced,
    HeldToControlPoints,
    LookAlikesRefused,
    LookedAgain,
    ModelDropped,
    ModelRefined,
    ModelsJoined,
    ModelStarted,
    PhotoAdded,
    PhotoArrived,
    PhotoDescribed,
    PhotoPlaced,
    PhotoWaiting,
    RegisteredStructureLess,
    SessionEnded,
    SessionStarted,
)
from sfm_front.runtime.closeable import Closeable
from sfm_front.types import Skipped

FILE = "events.jsonl"
VERSION = 1

_NAMES: dict[type, str] = {
    SessionStarted: "session_started",
    PhotoArrived: "photo_arrived",
    Skipped: "photo_skipped",
    PhotoDescribed: "photo_described",
    PhotoAdded: "photo_added",
    PhotoPlaced: "photo_placed",
    PhotoWaiting: "photo_waiting",
    ModelStarted: "model_started",
    ModelRefined: "model_refined",
    ModelDropped: "model_dropped",
    ModelsJoined: "models_joined",
    LookAlikesRefused: "look_alikes_refused",
    RegisteredStructureLess: "registered_structure_less",
    LookedAgain: "looked_again",
    Georeferenced: "georeferenced",
    HeldToControlPoints: "held_to_control_points",
    ControlPointsRefused: "control_points_refused",
    FinishingBegan: "finishing_began",
    SessionEnded: "session_ended",
}


class EventLog(Closeable):
    """Writes events to a stream; each line is handed to the system at once."""

    def __init__(self, stream: IO[str], last_added: int | None = None) -> None:
        """``last_added``: image id of the last photo that an earlier process acknowledged there, 0
        before the first; None if there was no such file."""
        self._stream = stream
        self._last_added = last_added

    @classmethod
    def in_folder(cls, output: Path) -> EventLog:
        """Append to ``output/events.jsonl``; a line that a killed process left torn is removed."""
        file = output / FILE
        last_added = _last_added(_whole_lines(file)) if file.is_file() else None
        return cls(file.open("a", encoding="utf-8"), last_added)

    def lacks(self, image_id: int) -> bool:
        """Whether the process that stored a photo ended before it could acknowledge it here."""
        return self._last_added is not None and image_id > self._last_added

    def write(self, event: Event) -> None:
        """Write an event. Raises StorageError where it cannot be written."""
        try:
            self._stream.write(as_line(event) + "\n")
            self._stream.flush()
        except OSError as error:
            raise StorageError(f"{FILE}: cannot be written ({error.strerror}).") from error

    def close(self) -> None:
        # Fails only for a line of which ``write`` has told already.
        with suppress(OSError):
            self._stream.close()


def as_line(event: Event, now: Callable[[], datetime] | None = None) -> str:
    """An event as a line of JSON, without its end."""
    time = now() if now else datetime.now(timezone.utc)
    content = {
        "v": VERSION,
        "time": time.isoformat(timespec="milliseconds"),
        "event": _NAMES[type(event)],
        **_fields(event),
    }
    return json.dumps(content, ensure_ascii=False, default=_plain)


def _fields(event: Event) -> dict[str, Any]:
    fields = asdict(event)
    if isinstance(event, PhotoAdded):
        # Those have lines of their own.
        del fields["events"]
        fields["verified"] = event.verified
        fields["most_relevant"] = event.most_relevant
    return fields


def _plain(value: object) -> object:
    if isinstance(value, Enum):
        return value.value if isinstance(value.value, str) else value.name
    return str(value)


def _whole_lines(file: Path) -> bytes:
    """What is in it, once what a killed process left of a line is removed."""
    with file.open("rb+") as content:
        data = content.read()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            content.truncate(whole)
    return data[:whole]


def _last_added(lines: bytes) -> int:
    """Image id of the photo that was acknowledged last; 0 if none was."""
    # Within the values of a line, quotes are escaped.
    place = lines.rfind(b'"event": "photo_added"')
    if place < 0:
        return 0
    line = lines[lines.rfind(b"\n", 0, place) + 1 : lines.index(b"\n", place)]
    return int(json.loads(line)["image_id"])
