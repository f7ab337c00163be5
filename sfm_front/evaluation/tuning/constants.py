"""The tuned options that have a name, and which of their values to try."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sfm_front.errors import ConfigError
from sfm_front.evaluation.tuning.option_paths import (
    Value,
    check_path,
    nearest,
    parse_value,
    paths,
    value_at,
    with_value,
)
from sfm_front.session.options import SessionOptions


@dataclass(frozen=True, slots=True)
class Constant:
    """An option worth trying. ``name``: its anchor in TUNING.md. ``decides``: what it is for."""

    name: str
    path: str
    values: tuple[Value, ...]
    decides: str


CONSTANTS = (
    Constant(
        "guided-ratio",
        "guided.max_ratio",
        (0.6, 0.7, 0.8),
        "how much nearer than the next best a guided match must be",
    ),
    Constant(
        "guided-agreement",
        "guided.min_agreeing",
        (0.7, 0.8, 0.9),
        "share of the re-ranking's inliers that must agree with the poses before they guide",
    ),
    Constant(
        "rerank-floor",
        "pair_matching.min_inliers",
        (8, 11, 15),
        "inliers of the second re-ranking below which a pair is not matched on all features",
    ),
    Constant(
        "lens-gain",
        "atlas.mapper.calibration.min_gain",
        (0.0, 0.005, 0.01, 0.02, 0.035, 0.99),
        "fall of the median error for which a richer lens or a refined principal point is kept; "
        "0.99: never",
    ),
    Constant(
        "retry-growth",
        "atlas.mapper.retry_growth",
        (1.0, 1.2, 1.5),
        "how many times the points a photo must see before it is tried again",
    ),
    Constant(
        "matched-first",
        "pair_matching.num_matched_first",
        (2, 3, 5),
        "candidates matched without guidance",
    ),
    Constant(
        "refinement-growth",
        "atlas.mapper.schedule.growth",
        (1.15, 1.25, 1.5),
        "growth of a model after which all of it is refined",
    ),
    Constant(
        "localization-inliers",
        "atlas.localization.min_inliers",
        (20, 30, 50),
        "points that a pose must fit before it guides",
    ),
)


@dataclass(frozen=True, slots=True)
class Sweep:
    """One option and the values to try, the current one among them.

    ``options``: by value, those of a whole session.
    """

    title: str
    path: str
    current: Value
    options: dict[Value, SessionOptions]


def make_sweep(name: str, values: Sequence[str] | None, base: SessionOptions) -> Sweep:
    """What to try for an option: of ``CONSTANTS`` by name or path, or any other by its path.

    ``values`` as text, instead of the constant's own. Raises ConfigError for an unknown option, one
    outside ``CONSTANTS`` without values, or a value that cannot be.
    """
    constant = next((c for c in CONSTANTS if name in (c.name, c.path)), None)
    path = constant.path if constant else name
    if constant is None and "." not in name and name not in paths(base):
        names = [*(c.name for c in CONSTANTS), *paths(base)]
        raise ConfigError(f"{name}: no such option; did you mean {nearest(name, names)}?")
    check_path(path)
    if values is not None:
        chosen = [parse_value(path, text) for text in values]
    elif constant is not None:
        chosen = list(constant.values)
    else:
        raise ConfigError(f"{path}: has no values of its own to try; give some with --values")
    current = value_at(base, path)
    if current not in chosen:
        chosen.append(current)
    if not isinstance(current, str):
        chosen.sort()
    title = f"{path} ({constant.name}): {constant.decides}" if constant else path
    return Sweep(title, path, current, {v: with_value(base, path, v) for v in chosen})
