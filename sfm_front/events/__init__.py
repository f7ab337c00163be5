"""What happens in a session, as it happens: one type per kind of event."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from sfm_front.events.model_events import (
    ControlPointsRefused,
    DropReason,
    Evidence,
    Georeferenced,
    HeldToControlPoints,
    LookAlikesRefused,
    LookedAgain,
    ModelDropped,
    ModelEvent,
    ModelRefined,
    ModelsJoined,
    ModelStarted,
    RegisteredStructureLess,
    StartKind,
)
from sfm_front.events.photo_events import (
    PREFETCHED_STAGES,
    PhotoAdded,
    PhotoArrived,
    PhotoDescribed,
    PhotoEvent,
    PhotoPlaced,
    PhotoWaiting,
)
from sfm_front.events.session_events import (
    FinishingBegan,
    FinishingStep,
    ModelTurn,
    SessionEnded,
    SessionEvent,
    SessionStarted,
)

__all__ = [
    "PREFETCHED_STAGES",
    "ControlPointsRefused",
    "DropReason",
    "Emit",
    "Event",
    "Evidence",
    "FinishingBegan",
    "FinishingStep",
    "Georeferenced",
    "HeldToControlPoints",
    "Listener",
    "LookAlikesRefused",
    "LookedAgain",
    "ModelDropped",
    "ModelEvent",
    "ModelRefined",
    "ModelStarted",
    "ModelTurn",
    "ModelsJoined",
    "PhotoAdded",
    "PhotoArrived",
    "PhotoDescribed",
    "PhotoEvent",
    "PhotoPlaced",
    "PhotoWaiting",
    "RegisteredStructureLess",
    "SessionEnded",
    "SessionEvent",
    "SessionStarted",
    "StartKind",
]

Event: TypeAlias = PhotoEvent | ModelEvent | SessionEvent
"""What a listener of a session hears of."""

Emit: TypeAlias = Callable[[ModelEvent], None]
Listener: TypeAlias = Callable[[Event], None]
