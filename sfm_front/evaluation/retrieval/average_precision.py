"""The accuracy of rankings: average precision and related measures, by the official definitions.

Average precision is the area under the curve of precision over recall, cut into trapezoids, where
precision before the first answer is 1. Written differently, it is the same number in

- Oxford5k's and Paris6k's ``compute_ap.cpp`` (Philbin, Arandjelovic and Zisserman): good and ok
  photos are positives, junk is skipped, the query counts if it is listed, as always in Oxford5k;
- INRIA Holidays' ``holidays_map.py`` (Jegou and Douze): the query itself is skipped;
- revisited Oxford and Paris' ``evaluate.py`` (Radenovic et al., CVPR 2018): junk is skipped, and
  queries without a positive are left out of the mean. Positives are the easy photos ("easy"), the
  easy and hard ones ("medium") or the hard ones ("hard"); the other kind is junk.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from statistics import fmean

from sfm_front.evaluation.retrieval.types import Query

RECALL_AT = (5, 10, 25)


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Means over the queries that have a relevant photo, in [0, 1]; ``num_queries`` of them.

    ``first_right``: the fraction of queries whose first answer is relevant, the precision at 1.
    ``recall``: by k, the fraction of a query's relevant photos among the first k answers. It cannot
    reach 1 if more than k are relevant.
    """

    num_queries: int
    mean_average_precision: float
    first_right: float
    recall: Mapping[int, float]


def average_precision(
    ranking: Iterable[str], relevant: AbstractSet[str], ignored: AbstractSet[str] = frozenset()
) -> float:
    """Area under precision over recall, in [0, 1]. ``relevant`` must not be empty.

    ``ranking``: names, best first. Those in ``ignored`` count as absent, relevant or not.
    """
    area, found, before = 0.0, 0, 1.0
    for position, name in enumerate(_counted(ranking, ignored), start=1):
        is_relevant = name in relevant
        found += is_relevant
        precision = found / position
        if is_relevant:  # else recall, the width of the trapezoid, does not grow
            area += (before + precision) / 2
        before = precision
    return area / len(relevant)


def assess(rankings: Sequence[Sequence[str]], queries: Sequence[Query]) -> Accuracy | None:
    """Assess one ranking of names per query; None if no query has a relevant photo."""
    answered = [
        (_counted(ranking, query.ignored), query.relevant)
        for ranking, query in zip(rankings, queries, strict=True)
        if query.relevant
    ]
    if not answered:
        return None
    return Accuracy(
        num_queries=len(answered),
        mean_average_precision=fmean(average_precision(*one) for one in answered),
        first_right=fmean(recall_at(1, *one) > 0 for one in answered),
        recall={k: fmean(recall_at(k, *one) for one in answered) for k in RECALL_AT},
    )


def recall_at(k: int, ranking: Sequence[str], relevant: AbstractSet[str]) -> float:
    """Fraction of the ``relevant`` photos among the first ``k`` of the ranking."""
    return sum(name in relevant for name in ranking[:k]) / len(relevant)


def _counted(ranking: Iterable[str], ignored: AbstractSet[str]) -> list[str]:
    return [name for name in ranking if name not in ignored]
