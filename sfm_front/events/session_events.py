"""What happens to a session as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeAlias


@dataclass(frozen=True, slots=True)
class SessionStarted:
    """A session begins, or goes on: ``num_photos`` of it are there already.

    ``command``: what goes on with it if it is stopped; empty where that is not known.
    """

    version: str
    options: dict[str, Any]
    num_photos: int = 0
    command: str = ""


class FinishingStep(Enum):
    """What a session is at once no more photos come; some take minutes for a long flight."""

    LOOK_AGAIN = "matching poorly connected photos once more"
    REFINE = "refining the models"
    START_AFRESH = "looking for a better start, and a place for photos without one"
    LAST_ADJUSTMENT = "last adjustment of all cameras and points"
    CONTROL_POINTS = "fitting the model to control points"
    CHECK = "checking the models"
    WRITE = "writing the models"


@dataclass(frozen=True, slots=True)
class ModelTurn:
    """It is the turn of a model, the ``number``-th of ``num_models``, with so many photos."""

    model_id: int
    number: int
    num_models: int
    num_photos: int


@dataclass(frozen=True, slots=True)
class FinishingBegan:
    """A step of the session's end begins, the ``number``-th of ``num_steps``.

    ``turn``: of one that takes the models one after the other and begins for each.
    """

    step: FinishingStep
    number: int = 1
    num_steps: int = 1
    turn: ModelTurn | None = None


@dataclass(frozen=True, slots=True)
class SessionEnded:
    """All models are written, or, if not ``finished``, those of the last snapshot stay.

    ``num_left``: photos of which it knew, and which it has not taken, for it was stopped before.
    """

    finished: bool
    num_photos: int
    num_registered: int
    num_models: int
    num_left: int = 0


SessionEvent: TypeAlias = SessionStarted | FinishingBegan | SessionEnded
