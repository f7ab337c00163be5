"""What happens to models."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias


class StartKind(Enum):
    """When a model is started, and in what way."""

    STREAM = "started"
    LAST_CALL = "started at the end"
    RESTART = "grown afresh"
    FIXED_INTRINSICS = "grown afresh, the camera held as EXIF has it"


@dataclass(frozen=True, slots=True)
class ModelStarted:
    """A model of two photos; the pair met at least this angle and this number of inliers."""

    model_id: int
    image_ids: tuple[int, int]
    min_angle_deg: float
    min_inliers: int
    kind: StartKind

    def __str__(self) -> str:
        first, second = self.image_ids
        return (
            f"model {self.model_id} {self.kind.value}: from images {first} and {second}, "
            f"demanding {self.min_angle_deg:g} degrees and {self.min_inliers} inliers"
        )


class DropReason(Enum):
    """Why a model is given up."""

    COVERED = "a larger one holds them all"
    NO_BETTER = "another start holds as many"
    REPLACED = "grown afresh with its camera fixed"
    TOO_SMALL = "too few that no larger one holds"


@dataclass(frozen=True, slots=True)
class ModelDropped:
    """A model is given up, with the photos registered in it."""

    model_id: int
    num_registered: int
    reason: DropReason

    def __str__(self) -> str:
        return f"model {self.model_id} of {self.num_registered} photos dropped: {self.reason.value}"


@dataclass(frozen=True, slots=True)
class ModelRefined:
    """A whole model was refined, in ``seconds`` of wall time.

    ``median_shift`` and ``max_shift``: how far the cameras of its photos moved against each other,
    in units of the model before.
    """

    model_id: int
    num_registered: int
    num_points: int
    seconds: float
    median_shift: float = 0.0
    max_shift: float = 0.0

    def __str__(self) -> str:
        return (
            f"model {self.model_id} refined: {self.num_registered} photos, "
            f"{self.num_points} points, {self.seconds:.2f} s"
        )


class Evidence(Enum):
    """What shows that two groups of photos are not where a model has them."""

    SURROUNDINGS = "beside what looks alike they see different things"
    MATCHES = "most of the matches between them say otherwise"


@dataclass(frozen=True, slots=True)
class LookAlikesRefused:
    """Two groups of photos show things that look alike, and had been taken for one place.

    The ``num_matches`` that said so are no longer believed. The groups of image ids, the larger
    first, come together again only by other matches.
    """

    model_id: int
    image_ids: tuple[tuple[int, ...], tuple[int, ...]]
    evidence: Evidence
    num_matches: int

    def __str__(self) -> str:
        first, second = (_listed(group) for group in self.image_ids)
        return (
            f"model {self.model_id} taken apart: images {first} and images {second} are not in one "
            f"place, {self.evidence.value}; {self.num_matches} matches refused"
        )


@dataclass(frozen=True, slots=True)
class ModelsJoined:
    """A model took in another one, which is no model of its own any more, in ``seconds``.

    ``num_registered``: photos of either before. ``bridges``: image ids of the photos on whose
    matches the join rests; ``num_matches``: points of both models that they show to be the same.
    """

    model_id: int
    joined_model_id: int
    num_registered: tuple[int, int]
    bridges: tuple[int, ...]
    num_matches: int
    seconds: float

    def __str__(self) -> str:
        ours, theirs = self.num_registered
        return (
            f"model {self.joined_model_id} of {theirs} photos joined to model {self.model_id} of "
            f"{ours}: {self.num_matches} common points by {len(self.bridges)} bridge photos, "
            f"{self.seconds:.2f} s"
        )


@dataclass(frozen=True, slots=True)
class RegisteredStructureLess:
    """Photos that see too few points were registered by two-view geometry."""

    model_id: int
    image_ids: tuple[int, ...]

    def __str__(self) -> str:
        return f"{len(self.image_ids)} photos registered without structure in model {self.model_id}"


@dataclass(frozen=True, slots=True)
class LookedAgain:
    """A poorly connected photo was matched with more others, on all features.

    ``found``: those of the ``num_tried`` that overlap with it. ``num_left``: pairs that may still
    be tried, for all photos.
    """

    image_id: int
    found: tuple[int, ...]
    num_tried: int
    num_left: int

    def __str__(self) -> str:
        return (
            f"looked again at image {self.image_id}: {len(self.found)} of {self.num_tried} "
            f"further photos overlap; {self.num_left} more pairs may be tried"
        )


@dataclass(frozen=True, slots=True)
class Georeferenced:
    """Positions say where a model stands on the earth, or how well that is known has changed.

    ``state``: none, provisional or metric; a metric model is in ENU from here on, ``origin`` its
    latitude and longitude in degrees and altitude in metres. ``num_used`` of ``num_positions`` are
    right. ``scale_sigma``: standard deviation of the scale, as a share of it; None without a scale.
    ``reasons``: why it is no better.
    """

    model_id: int
    state: str
    origin: tuple[float, float, float] | None
    num_used: int
    num_positions: int
    scale_sigma: float | None
    reasons: tuple[str, ...]

    def __str__(self) -> str:
        scale = "" if self.scale_sigma is None else f", scale within {self.scale_sigma:.1%}"
        why = "".join(f"; {reason}" for reason in self.reasons)
        return (
            f"model {self.model_id} is {self.state} by {self.num_used} of {self.num_positions} "
            f"positions{scale}{why}"
        )


@dataclass(frozen=True, slots=True)
class HeldToControlPoints:
    """A finished model was moved and adjusted to control points.

    It is in ENU, ``origin`` its latitude and longitude in degrees and altitude in metres.
    ``ce90_m`` and ``le90_m``: of the checkpoints, or of the control points where there are none;
    None where no point says.
    """

    model_id: int
    origin: tuple[float, float, float]
    num_control: int
    num_checkpoints: int
    ce90_m: float | None
    le90_m: float | None

    def __str__(self) -> str:
        within = "".join(
            f", {name} {value:.3f} m"
            for name, value in (("CE90", self.ce90_m), ("LE90", self.le90_m))
            if value is not None
        )
        points = f"{self.num_control} control points and {self.num_checkpoints} checkpoints"
        return f"model {self.model_id} is held to {points}{within}"


@dataclass(frozen=True, slots=True)
class ControlPointsRefused:
    """Control points cannot hold a model, as far as photos have come; it is left as it is."""

    reason: str

    def __str__(self) -> str:
        return f"control points cannot be used: {self.reason}"


ModelEvent: TypeAlias = (
    ModelStarted
    | ModelDropped
    | ModelRefined
    | ModelsJoined
    | LookAlikesRefused
    | RegisteredStructureLess
    | LookedAgain
    | Georeferenced
    | HeldToControlPoints
    | ControlPointsRefused
)


def _listed(image_ids: tuple[int, ...]) -> str:
    """Consecutive numbers as ranges: 1-7, 9."""
    runs: list[list[int]] = []
    for image_id in image_ids:
        if runs and image_id == runs[-1][-1] + 1:
            runs[-1][1:] = [image_id]
        else:
            runs.append([image_id])
    return ", ".join("-".join(map(str, run)) for run in runs)
