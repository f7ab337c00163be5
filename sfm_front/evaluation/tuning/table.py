"""The trials of an option's values as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import mean

from sfm_front.evaluation.poses import AUC_THRESHOLDS_DEG
from sfm_front.evaluation.tuning.constants import Sweep
from sfm_front.evaluation.tuning.option_paths import Value
from sfm_front.evaluation.tuning.trials import Trial, TrialKey

Row = Mapping[str, Trial]
"""The trials of one scene and one value, by arrangement."""


def format_sweep(sweep: Sweep, trials: Mapping[TrialKey, Trial]) -> str:
    """A line per value over all scenes and, below, one per scene whose photos or AUC differ.

    Columns of arrangements and the cells of scenes count photos in the largest model, ``all`` those
    in any; ``error px`` and AUC, in percent, are means over scenes and arrangements, AUC over those
    with ground truth. ``lost`` and ``gained`` count scenes whose registered
    photos, summed over arrangements, are fewer or more than with the current value, marked ``*``.
    """
    by_value = {value: _rows(trials, options) for value, options in sweep.options.items()}
    now = by_value[sweep.current]
    summary = [_summary(_label(sweep, value), rows, now) for value, rows in by_value.items()]
    text = [sweep.title, *_lines([list(summary[0]), *(list(line.values()) for line in summary)])]
    differing = []
    for scene in now:
        cells = [_cell(rows[scene], now[scene]) for rows in by_value.values()]
        if len(set(cells)) > 1:
            differing.append([scene, *cells])
    if differing:
        arrangements = "+".join(_arrangements(now))
        header = [f"scene ({arrangements})", *(_label(sweep, value) for value in by_value)]
        text += ["", *_lines([header, *differing])]
    else:
        text.append("no scene differs in registered photos or AUC")
    return "\n".join(text)


def _rows(trials: Mapping[TrialKey, Trial], options: object) -> Mapping[str, Row]:
    rows: dict[str, dict[str, Trial]] = {}
    for key, trial in trials.items():
        if key.options == options:
            rows.setdefault(key.scene, {})[key.arrangement] = trial
    return rows


def _arrangements(rows: Mapping[str, Row]) -> list[str]:
    return list(dict.fromkeys(name for row in rows.values() for name in row))


def _label(sweep: Sweep, value: Value) -> str:
    return f"{value}*" if value == sweep.current else str(value)


def _summary(label: str, rows: Mapping[str, Row], now: Mapping[str, Row]) -> dict[str, str]:
    trials = [trial for row in rows.values() for trial in row.values()]
    changes = [_registered(rows[scene]) - _registered(now[scene]) for scene in rows]
    line = {"value": label}
    for arrangement in _arrangements(now):
        here = [row[arrangement] for row in rows.values() if arrangement in row]
        line[arrangement] = (
            f"{sum(t.quality.registered for t in here)}/{sum(t.photos for t in here)}"
        )
    line["all"] = str(sum(trial.quality.registered_in_all for trial in trials))
    line["models"] = str(sum(trial.quality.models for trial in trials))
    line["lost"] = str(sum(change < 0 for change in changes))
    line["gained"] = str(sum(change > 0 for change in changes))
    areas = [trial.quality.auc for trial in trials if trial.quality.auc is not None]
    for threshold, values in zip(AUC_THRESHOLDS_DEG, zip(*areas, strict=True), strict=False):
        line[f"AUC@{threshold:g}"] = f"{100 * mean(values):.2f}"
    line["pairs"] = str(sum(trial.verified_pairs for trial in trials))
    line["points"] = str(sum(trial.quality.points for trial in trials))
    errors = [
        trial.quality.reprojection_error_px
        for trial in trials
        if trial.quality.reprojection_error_px is not None
    ]
    line["error px"] = f"{mean(errors):.3f}" if errors else "-"
    seconds = sum(trial.seconds for row in now.values() for trial in row.values())
    line["time"] = f"{sum(trial.seconds for trial in trials) / seconds:.2f}"
    return line


def _registered(row: Row) -> int:
    return sum(trial.quality.registered for trial in row.values())


def _cell(row: Row, now: Row) -> str:
    """``11+11+10 (-1) AUC 80.1/91.2/95.0``: how it differs from now in brackets."""
    text = "+".join(str(trial.quality.registered) for trial in row.values())
    change = _registered(row) - _registered(now)
    if change:
        text += f" ({change:+d})"
    areas = [trial.quality.auc for trial in row.values() if trial.quality.auc is not None]
    if areas:
        means = (f"{100 * mean(values):.1f}" for values in zip(*areas, strict=True))
        text += f" AUC {'/'.join(means)}"
    return text


def _lines(table: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join([first.ljust(widths[0]), *map(str.rjust, rest, widths[1:])])
        for first, *rest in table
    ]
