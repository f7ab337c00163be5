"""Which workers are used, and what is said where there are none."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterable

import pytest

from sfm_front.cluster import connection
from sfm_front.cluster.connection import Cluster, connected
from sfm_front.cluster.options import ClusterOptions
from sfm_front.errors import ConfigError, InputError


def test_nobody_at_the_address_is_one_line_within_seconds() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    started = time.monotonic()
    with (
        pytest.raises(InputError, match="no Dask scheduler answers") as caught,
        connected(ClusterOptions(address=address), print),
    ):
        pass
    assert "\n" not in str(caught.value)
    assert time.monotonic() - started < 60  # 5 s; the machine may be busy


@pytest.mark.slow
def test_a_worker_with_another_package_is_not_used(
    threads: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    first, second = threads.workers
    ask = Cluster._ask

    def other(cluster: Cluster, addresses: Iterable[str]) -> dict[str, str]:
        found = ask(cluster, addresses)
        return {**found, first: "0.0.9 (abc), pycolmap 4.1.1"} if first in found else found

    monkeypatch.setattr(Cluster, "_ask", other)
    cluster = Cluster(threads.client, "inproc", told.append)
    cluster.require_workers()
    assert cluster.workers == {second}
    assert len(told) == 1
    assert told[0].startswith(f"worker {first} is not used: it has 0.0.9 (abc), pycolmap 4.1.1")
    cluster.look()
    assert len(told) == 1


def test_a_worker_that_has_gone_is_told_of_once(threads: Cluster) -> None:
    told: list[str] = []
    cluster = Cluster(threads.client, "inproc", told.append)
    cluster.require_workers()
    gone, left = sorted(cluster.workers)
    threads.client.retire_workers([gone])
    cluster.look()
    cluster.look()
    assert told == [f"worker {gone} is gone: what it had begun is begun again elsewhere"]
    assert cluster.workers == {left}


@pytest.mark.slow
def test_no_worker_with_this_package_is_an_error(
    threads: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "identity", lambda: "0.2.0")
    with pytest.raises(ConfigError, match="no worker at inproc can be used: they have"):
        Cluster(threads.client, "inproc", print).require_workers()


@pytest.mark.slow
def test_no_worker_at_all_is_waited_for_a_while(
    threads: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    threads.client.retire_workers()
    monkeypatch.setattr(connection, "_FIRST_WORKER_S", 0.1)
    with pytest.raises(InputError, match="no worker has come"):
        Cluster(threads.client, "inproc", told.append).require_workers()
    assert told == ["waiting for the first worker at inproc"]
