"""Search photos by photo with a method; assess and time its answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from statistics import median
from time import perf_counter
from typing import Any

from sfm_front.evaluation.retrieval.average_precision import Accuracy, assess
from sfm_front.evaluation.retrieval.material import Material, key_of
from sfm_front.evaluation.retrieval.types import BenchPhoto, Method, Staged


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a method on a dataset.

    ``indexed``: number of photos searched, including distractors. ``seconds`` per query without
    extraction: the median, for a ranking of all photos, which mean average precision needs.
    ``stage_seconds``: medians of the stages of a query, if the method is ``Staged``.
    """

    dataset: str
    method: str
    indexed: int
    accuracy: Accuracy | None
    seconds: float
    stage_seconds: Mapping[str, float]
    build_seconds: float

    def as_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class _Answer:
    names: list[str]
    seconds: float
    stage_seconds: Mapping[str, float]


def benchmark(method: Method, material: Material, note: Callable[[str], None]) -> list[Outcome]:
    """Index the photos once, ask each query once, and assess the answers for every dataset.

    A query that could not be described has an empty answer. ``note`` is called with a line per
    dataset.
    """
    started = perf_counter()
    method.build(material.photos)
    build_seconds = perf_counter() - started
    answers = {key: _ask(method, photo, material) for key, photo in material.queries.items()}
    outcomes = []
    for dataset in material.datasets:
        answered = [answers.get(key_of(query)) for query in dataset.queries]
        rankings = [answer.names if answer else [] for answer in answered]
        timed = [answer for answer in answered if answer]
        stages = dict.fromkeys(stage for answer in timed for stage in answer.stage_seconds)
        outcome = Outcome(
            dataset=dataset.name,
            method=method.name,
            indexed=len(material.photos),
            accuracy=assess(rankings, dataset.queries),
            seconds=median(answer.seconds for answer in timed),
            stage_seconds={
                stage: median(answer.stage_seconds[stage] for answer in timed) for stage in stages
            },
            build_seconds=build_seconds,
        )
        outcomes.append(outcome)
        note(_told(outcome))
    return outcomes


def _ask(method: Method, photo: BenchPhoto, material: Material) -> _Answer:
    started = perf_counter()
    ranked = method.rank(photo)
    seconds = perf_counter() - started
    stage_seconds = method.seconds if isinstance(method, Staged) else {}
    # Distractors have no name: they are never relevant.
    names = [material.names.get(one.image_id, "") for one in ranked]
    return _Answer(names, seconds, stage_seconds)


def _told(outcome: Outcome) -> str:
    told = f"{outcome.dataset}, {outcome.method}: {1000 * outcome.seconds:.1f} ms a query"
    if outcome.accuracy:
        told += f", mAP {outcome.accuracy.mean_average_precision:.3f}"
    return f"{told}, index built in {outcome.build_seconds:.1f} s"
