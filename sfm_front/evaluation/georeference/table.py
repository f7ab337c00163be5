"""Georeference trials as a table in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from sfm_front.evaluation.georeference.trial import GeoreferenceTrial

_HEADER = (
    "scene",
    "registered",
    "state",
    "metric at",
    "as it stands, m",
    "free fit, m",
    "scale",
    "move: scale",
    "tilt",
    "heading",
    "cameras",
    "bend",
)


def format_trials(trials: Sequence[GeoreferenceTrial]) -> str:
    """A row per scene, and below what is said of those of which something is.

    ``metric at``: after which photo of how many. ``as it stands`` and ``free fit``: median distance
    of the cameras from GPS. ``scale``: by how much it differs from that of the free fit. ``move``:
    the furthest from what was said first, in standard deviations as stated then.
    """
    lines = [_row(_HEADER), _row(["---"] * len(_HEADER))]
    lines += [_row(_cells(trial)) for trial in trials]
    said = [f"{trial.scene}: {reason}" for trial in trials for reason in trial.reasons]
    return "\n".join([*lines, *([""] if said else []), *said])


def _cells(trial: GeoreferenceTrial) -> list[str]:
    move = trial.largest_move
    moves = (move.scale, move.tilt, move.heading, move.cameras) if move else (None,) * 4
    first = "-" if trial.first_metric is None else f"{trial.first_metric} of {trial.photos}"
    return [
        trial.scene,
        f"{trial.registered}/{trial.photos}",
        trial.state,
        first,
        _number(trial.as_it_stands_m, ".2f"),
        _number(trial.free_fit_m, ".2f"),
        _number(None if trial.scale_ratio is None else trial.scale_ratio - 1, "+.2%"),
        *(_number(times, ".1f") for times in moves),
        _number(trial.bend_share, ".2%"),
    ]


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
