"""What fails is tried again, named, and left out; what is done is not done again."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from helpers.clustering import SMALL, run, village

from sfm_front.cluster import worker
from sfm_front.cluster.connection import Cluster
from sfm_front.cluster.coordinator import ClusterProgress
from sfm_front.cluster.work import DESCRIBE, GROW, MATCH
from sfm_front.cluster.workbench import Counts, Workbench
from sfm_front.session.session import Session
from sfm_front.types import Skipped

pytestmark = pytest.mark.slow


class _DiedError(Exception):
    """As a coordinator that is killed: nothing after it happens."""


def _failing(monkeypatch: pytest.MonkeyPatch, kind: str, is_bad: Any) -> Counter[str]:
    """Tasks of this kind fail if ``is_bad`` says so of their work; counts those that did."""
    do, failed = worker._DO[kind], Counter[str]()

    def fail(bench: Workbench, work: Any, counts: Counts) -> Any:
        if is_bad(work):
            failed[kind] += 1
            raise RuntimeError("no such luck\nand more lines")
        return do(bench, work, counts)

    monkeypatch.setattr(worker, "_DO", {**worker._DO, kind: fail})
    return failed


def test_a_photo_that_fails_three_times_is_named_and_skipped(
    threads: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad = village()[4].name
    failed = _failing(monkeypatch, DESCRIBE, lambda work: bad in {photo.name for photo in work})
    result = run(threads, tmp_path / "out", village()[:10])
    found = result.summary.cluster
    assert found is not None
    assert [(one.kind, one.photos, one.reason) for one in found.failed] == [
        (DESCRIBE, (bad,), "RuntimeError: no such luck")
    ]
    # Three times with its batch, three times alone.
    assert failed[DESCRIBE] == 6
    assert [photo.name for photo in result.summary.skipped] == [bad]
    assert result.models[0].num_registered == 9


def test_a_photo_whose_matching_fails_enters_without_pairs(
    threads: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _failing(monkeypatch, MATCH, lambda work: 5 in {query.image_id for query in work.queries})
    result = run(threads, tmp_path / "out", village()[:10])
    assert result.summary.cluster is not None
    assert [one.photos for one in result.summary.cluster.failed] == [(village()[4].name,)]
    assert len(result.summary.used) == 10
    assert result.models[0].num_registered >= 9


def test_photos_of_a_group_that_fails_are_placed_by_the_coordinator(
    threads: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    last = len(village())
    _failing(monkeypatch, GROW, lambda work: work.photos[-1].image_id == last)
    result = run(threads, tmp_path / "out", village())
    assert result.summary.cluster is not None
    (failed,) = result.summary.cluster.failed
    assert failed.kind == GROW
    assert village()[-1].name in failed.photos
    assert result.models[0].num_registered == last


@pytest.mark.parametrize("moment", ["matched", "grown"])
def test_a_coordinator_that_dies_is_gone_on_with(
    threads: Cluster, tmp_path: Path, moment: str
) -> None:
    last: list[ClusterProgress] = []

    def die(now: ClusterProgress) -> None:
        last.append(now)
        if (now.num_matched >= 9) if moment == "matched" else (now.num_grown == 1):
            raise _DiedError

    with pytest.raises(_DiedError):
        run(threads, tmp_path / "out", village(), on_progress=die)
    result = run(threads, tmp_path / "out", village(), resume=True)
    assert [model.num_registered for model in result.models] == [21]
    found = result.summary.cluster
    assert found is not None
    by_kind = {kind.kind: kind for kind in found.tasks}
    if moment == "matched":
        # Features lay in the output; matched photos are in the database.
        entered = 21 - by_kind[MATCH].items
        assert entered == last[-1].num_matched
        assert by_kind[DESCRIBE].items == 21 - entered
        assert by_kind[DESCRIBE].reused >= last[-1].num_described - entered
    else:
        assert set(by_kind) == {GROW}
        assert by_kind[GROW].count == 1
        assert len(found.groups) == 2


def test_one_process_goes_on_with_what_a_cluster_left(threads: Cluster, tmp_path: Path) -> None:
    def die(now: ClusterProgress) -> None:
        if now.num_matched >= 9:
            raise _DiedError

    with pytest.raises(_DiedError):
        run(threads, tmp_path / "out", village(), on_progress=die)
    with Session(tmp_path / "out", SMALL, resume=True) as session:
        there = session.num_restored
        assert there >= 9
        for photo in village()[there:]:
            session.add(photo.path)
        result = session.finish()
    assert [model.num_registered for model in result.models] == [21]
    assert result.summary.cluster is None
    assert not (tmp_path / "out" / "cluster").exists()


def test_photos_that_come_later_join_the_models_that_are_there(
    threads: Cluster, tmp_path: Path
) -> None:
    first = run(threads, tmp_path / "out", village()[:14])
    assert first.models[0].num_registered == 14
    result = run(threads, tmp_path / "out", village(), resume=True)
    assert [model.num_registered for model in result.models] == [21]
    assert result.summary.cluster is not None
    assert {kind.kind: kind.items for kind in result.summary.cluster.tasks}[MATCH] == 7


def test_stopped_it_finishes_with_the_photos_taken_so_far(threads: Cluster, tmp_path: Path) -> None:
    stopped: list[bool] = []

    def stop(now: ClusterProgress) -> None:
        if now.num_matched >= 6:
            stopped.append(True)

    result = run(
        threads, tmp_path / "out", village(), on_progress=stop, is_stopped=lambda: bool(stopped)
    )
    assert 6 <= len(result.summary.used) < 21
    assert result.models[0].num_registered >= 6
    assert not any(isinstance(photo, Skipped) for photo in result.summary.photos)
    again = run(threads, tmp_path / "out", village(), resume=True)
    assert [model.num_registered for model in again.models] == [21]
