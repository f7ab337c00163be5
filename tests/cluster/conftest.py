"""Workers on this machine: two processes, or two threads of this one."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from helpers.clustering import GROUPS

from sfm_front.cluster.connection import Cluster, connected


@pytest.fixture(scope="module")
def processes() -> Iterator[Cluster]:
    """As ``--cluster local:2`` starts them."""
    with connected(GROUPS, print) as cluster:
        yield cluster


@pytest.fixture
def threads() -> Iterator[Cluster]:
    """What is patched here is patched there."""
    distributed = pytest.importorskip("distributed")
    with distributed.Client(
        processes=False, n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0"
    ) as client:
        cluster = Cluster(client, "inproc", print)
        cluster.require_workers()
        yield cluster
