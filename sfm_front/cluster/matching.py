"""On a worker: photos and their candidates → verified pairs, as a session finds them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from sfm_front.cluster.work import MatchedPhoto, MatchWork, Query
from sfm_front.cluster.workbench import Counts, Workbench
from sfm_front.matching.nearest_neighbors import NO_MATCHES
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.types import View


def match(bench: Workbench, work: MatchWork, counts: Counts) -> list[MatchedPhoto]:
    """Each photo with its candidates, all without guidance: nothing has a pose yet."""
    bench.feature_keys.update(work.keys)
    bench.sent = dict(work.sent)
    views = _Views(bench, work)
    read_before = bench.bytes_read
    matched = [_match(bench, query, views) for query in work.queries]
    counts.items += len(matched)
    counts.bytes_in += bench.bytes_read - read_before
    bench.sent = {}
    return matched


def _match(bench: Workbench, query: Query, views: Mapping[int, View]) -> MatchedPhoto:
    clock, view = Stopwatch(), views[query.image_id]
    with clock.stage("rerank"):
        enough = bench.options.pair_matching.num_matched
        ranked = bench.matching.reranker.rerank(view, query.candidates, views, enough=enough)
    pairs, rejected = bench.matching.pairs.match(
        view,
        ranked,
        views,
        locate=lambda _view, _pairs: None,
        poses_of=lambda _image_ids: {},
        clock=clock,
    )
    return MatchedPhoto(
        query.image_id,
        tuple(replace(candidate, matches=NO_MATCHES) for candidate in ranked),
        tuple(pairs),
        rejected,
        clock.seconds,
    )


class _Views(Mapping[int, View]):
    """Photos of a task, whose features are loaded when they are looked at."""

    def __init__(self, bench: Workbench, work: MatchWork) -> None:
        self._bench = bench
        self._cameras = work.cameras

    def __getitem__(self, image_id: int) -> View:
        return View(image_id, self._cameras[image_id], self._bench.features[image_id])

    def __iter__(self) -> Iterator[int]:
        return iter(self._cameras)

    def __len__(self) -> int:
        return len(self._cameras)
