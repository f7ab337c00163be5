"""The retrieval benchmark as a table: a row per dataset and measure, a column per method."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.evaluation.reconstruction.table import aligned
from sfm_front.evaluation.retrieval.average_precision import RECALL_AT
from sfm_front.evaluation.retrieval.benchmark import Outcome

_NONE = "-"
_SECONDS = "s/query"
# The two steps of hierarchical retrieval, which the paper times separately.
_STEPS = ("coarse", "fine")


@dataclass(frozen=True, slots=True)
class Line:
    """One measure on one dataset, a value per method; None if a method has none."""

    dataset: str
    measure: str
    values: tuple[float | None, ...]

    @property
    def cells(self) -> list[str]:
        """Text: seconds with four decimals, all else with three."""
        form = ".4f" if _is_seconds(self.measure) else ".3f"
        shown = (_NONE if value is None else format(value, form) for value in self.values)
        return [self.dataset, self.measure, *shown]


def format_table(outcomes: Sequence[Outcome]) -> str:
    """The table as text, with a blank line between datasets."""
    methods, lines = tabulate(outcomes)
    cells = [["dataset", "measure", *methods], *(line.cells for line in lines)]
    widths = [max(len(line[column]) for line in cells) for column in range(len(cells[0]))]
    text = [aligned(cells[0], widths), "  ".join("-" * width for width in widths)]
    dataset = lines[0].dataset
    for line in lines:
        if line.dataset != dataset:
            text.append("")
            dataset = line.dataset
        text.append(aligned(line.cells, widths))
    return "\n".join(text)


def write_csv(outcomes: Sequence[Outcome], out: Path) -> None:
    """The same table with all digits. Raises ``InputError`` if it cannot be written."""
    methods, lines = tabulate(outcomes)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with out.open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["dataset", "measure", *methods])
            rows.writerows([line.dataset, line.measure, *line.values] for line in lines)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror})") from error


def tabulate(outcomes: Sequence[Outcome]) -> tuple[list[str], list[Line]]:
    """The methods, and the lines with a value for each of them."""
    methods = list(dict.fromkeys(outcome.method for outcome in outcomes))
    lines = []
    for dataset in dict.fromkeys(outcome.dataset for outcome in outcomes):
        of_method = {one.method: measures(one) for one in outcomes if one.dataset == dataset}
        found = dict.fromkeys(name for values in of_method.values() for name in values)
        for measure in sorted(found, key=_is_seconds, reverse=True):
            values = tuple(of_method.get(method, {}).get(measure) for method in methods)
            lines.append(Line(dataset, measure, values))
    return methods, lines


def measures(outcome: Outcome) -> dict[str, float]:
    """A method's figures on a dataset: seconds, and accuracies in [0, 1]."""
    values = {_SECONDS: outcome.seconds}
    for step in _STEPS:
        if step in outcome.stage_seconds:
            values[f"{step} s"] = outcome.stage_seconds[step]
    accuracy = outcome.accuracy
    if accuracy is not None:
        values["mAP"] = accuracy.mean_average_precision
        values["P@1"] = accuracy.first_right
        values.update((f"R@{k}", accuracy.recall[k]) for k in RECALL_AT)
    return values


def _is_seconds(measure: str) -> bool:
    return measure == _SECONDS or measure.endswith(" s")
