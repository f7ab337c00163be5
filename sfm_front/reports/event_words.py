"""Events of models as lines to read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from sfm_front.reports.words import counted

Event = Mapping[str, Any]


def in_words(event: Event) -> str:
    """Of a line of ``events.jsonl``; empty where there is nothing to say.

    Raises KeyError, TypeError or ValueError if a field is missing or no such.
    """
    words = _WORDS.get(event["event"])
    return "" if words is None else words(event)


def finishing_words(step: str, number: int, num_steps: int, turn: Event | None) -> str:
    """Of a step of a session's end; ``turn`` with the fields of ``ModelTurn``."""
    place = f" {number} of {num_steps}" if num_steps > 1 else ""
    words = f"finishing{place}: {step}"
    if turn is not None:
        photos = counted(turn["num_photos"], "photo")
        of = f"model {turn['number']} of {turn['num_models']}, " if turn["num_models"] > 1 else ""
        words += f" ({of}{photos})"
    return words


def _started(event: Event) -> str:
    there = int(event["num_photos"])
    return f"session goes on with {counted(there, 'photo')}" if there else "session started"


def _ended(event: Event) -> str:
    if not event["finished"]:
        return "session stopped; the same command goes on"
    left = int(event.get("num_left", 0))
    stopped = f"stopped with {counted(left, 'photo')} to go, " if left else ""
    photos, models = counted(event["num_photos"], "photo"), counted(event["num_models"], "model")
    return f"{stopped}finished: {event['num_registered']} of {photos} in {models}"


def _refined(event: Event) -> str:
    return (
        f"model {event['model_id']} refined: {counted(event['num_registered'], 'photo')}, "
        f"{event['num_points']} points, {event['seconds']:.1f} s"
    )


def _joined(event: Event) -> str:
    ours, theirs = event["num_registered"]
    return (
        f"model {event['joined_model_id']} ({counted(theirs, 'photo')}) joined to model "
        f"{event['model_id']} ({ours})"
    )


def _taken_apart(event: Event) -> str:
    first, second = map(len, event["image_ids"])
    return f"model {event['model_id']} taken apart: look-alikes, {first} and {second} photos"


def _georeferenced(event: Event) -> str:
    why = "; ".join(map(str, event["reasons"]))
    state = "in metres" if event["state"] == "metric" else f"position {event['state']}"
    used = f"{event['num_used']} of {event['num_positions']} positions"
    return f"model {event['model_id']} {state} by {used}" + (f": {why}" if why else "")


_WORDS: dict[str, Callable[[Event], str]] = {
    "session_started": _started,
    "session_ended": _ended,
    "finishing_began": lambda e: finishing_words(
        str(e["step"]), e.get("number", 1), e.get("num_steps", 1), e.get("turn")
    ),
    "model_started": lambda e: f"model {e['model_id']} {e['kind']}",
    "model_refined": _refined,
    "model_dropped": lambda e: f"model {e['model_id']} dropped: {e['reason']}",
    "models_joined": _joined,
    "look_alikes_refused": _taken_apart,
    "registered_structure_less": lambda e: (
        f"{counted(len(e['image_ids']), 'photo')} placed by two-view geometry alone"
    ),
    "georeferenced": _georeferenced,
    "held_to_control_points": lambda e: (
        f"model {e['model_id']} held to {counted(e['num_control'], 'control point')}"
    ),
    "control_points_refused": lambda e: f"control points cannot be used: {e['reason']}",
}
