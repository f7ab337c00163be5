"""The lines of events.jsonl and the times of the copies -> what each photo waited for."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sfm_front.events import PREFETCHED_STAGES


@dataclass(frozen=True, slots=True)
class LivePhoto:
    """A photo's way from a whole file to its pose.

    ``noticed_s``: from its complete copy until it arrived in the session; ``placed_s``: from its
    complete copy until it had its pose; None if that never came. ``stages``: seconds by stage of
    its own work; they may overlap with those of other photos.
    """

    name: str
    noticed_s: float | None = None
    placed_s: float | None = None
    stages: dict[str, float] = field(default_factory=dict)

    @property
    def arrived_to_placed_s(self) -> float | None:
        """From its arrival in the session until it had its pose."""
        if self.noticed_s is None or self.placed_s is None:
            return None
        return self.placed_s - self.noticed_s

    @property
    def turn_s(self) -> float:
        """Work in its turn: what ran ahead beside other photos is left out."""
        return sum(s for stage, s in self.stages.items() if stage not in PREFETCHED_STAGES)


@dataclass(frozen=True, slots=True)
class Refinement:
    """A global refinement of a model, and whether photos were still to be taken after it."""

    num_registered: int
    seconds: float
    while_photos_came: bool


@dataclass(frozen=True, slots=True)
class Timeline:
    """A watched session: photos in the order they were sent."""

    photos: tuple[LivePhoto, ...]
    refinements: tuple[Refinement, ...]


def read_timeline(complete: Mapping[str, float], lines: Iterable[str]) -> Timeline:
    """``complete``: name → when its copy was complete, in seconds of ``time.time``; ``lines``:
    those of one session's ``events.jsonl``."""
    arrived: dict[str, float] = {}
    placed: dict[str, float] = {}
    stages: dict[str, dict[str, float]] = {}
    refined: list[tuple[float, dict[str, Any]]] = []
    last_added = 0.0
    for line in lines:
        event = json.loads(line)
        kind, time_s = event["event"], datetime.fromisoformat(event["time"]).timestamp()
        if kind == "photo_arrived":
            arrived[event["name"]] = time_s
        elif kind == "photo_added":
            stages[event["name"]] = event["seconds"]
            last_added = time_s
        elif kind == "photo_placed":
            placed.setdefault(event["name"], time_s)
        elif kind == "model_refined":
            refined.append((time_s, event))
    return Timeline(
        tuple(
            LivePhoto(
                name,
                arrived[name] - complete_s if name in arrived else None,
                placed[name] - complete_s if name in placed else None,
                stages.get(name, {}),
            )
            for name, complete_s in complete.items()
        ),
        tuple(
            Refinement(event["num_registered"], event["seconds"], time_s < last_added)
            for time_s, event in refined
        ),
    )
