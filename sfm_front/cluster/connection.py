"""The client of a Dask cluster, which is started here or runs already."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from sfm_front.cluster.identity import identity
from sfm_front.cluster.options import ClusterOptions, check_installed
from sfm_front.errors import ConfigError, InputError

if TYPE_CHECKING:
    from distributed import Client

# A scheduler that does not answer within this time is not there.
_CONNECT_S = 5
# How long the first worker may be waited for.
_FIRST_WORKER_S = 60
# pycolmap holds the interpreter's lock while it adjusts: a worker says nothing meanwhile.
_SILENT = "60 minutes"
_ASK = "__import__('sfm_front.cluster.identity', fromlist=['identity']).identity()"


class Cluster:
    """Those workers of a scheduler that have this package; others, also ones that join later, are
    left alone and given nothing."""

    def __init__(self, client: Client, address: str, note: Callable[[str], None]) -> None:
        self.client = client
        self.address = address
        self.note = note
        self._threads: dict[str, int] = {}
        self._refused: dict[str, str] = {}

    @property
    def dashboard(self) -> str | None:
        """Dask's own page; None without bokeh."""
        link: str | None = self.client.dashboard_link
        return link

    @property
    def workers(self) -> frozenset[str]:
        """Addresses of those that are used, when they were looked at last."""
        return frozenset(self._threads)

    @property
    def num_threads(self) -> int:
        """Tasks that can run at once."""
        return sum(self._threads.values())

    def look(self) -> None:
        """Note which workers have come and gone; a line for each that has gone or is not used."""
        there: dict[str, Any] = self.client.scheduler_info(n_workers=-1)["workers"]
        for address in self._threads.keys() - there.keys():
            self.note(f"worker {address} is gone: what it had begun is begun again elsewhere")
        new = there.keys() - self._threads.keys() - self._refused.keys()
        for address, found in self._ask(new).items():
            if found == identity():
                continue
            self._refused[address] = found
            self.note(f"worker {address} is not used: it has {found}, this is {identity()}")
        self._threads = {
            address: int(worker["nthreads"])
            for address, worker in there.items()
            if address not in self._refused
        }

    def require_workers(self) -> None:
        """Wait for the first one. Raises InputError if none comes, ConfigError if none can be
        used."""
        try:
            self.client.run_on_scheduler(eval, _ASK)
        except ImportError as error:
            raise ConfigError(
                f"the scheduler at {self.address} cannot load sfm-front ({error}): start it where "
                "this package is installed"
            ) from error
        if not self.client.scheduler_info(n_workers=-1)["workers"]:
            self.note(f"waiting for the first worker at {self.address}")
        try:
            self.client.wait_for_workers(1, timeout=_FIRST_WORKER_S)
        except TimeoutError as error:
            raise InputError(
                f"{self.address}: no worker has come in {_FIRST_WORKER_S} s. Start some with "
                f"dask worker {self.address} --nthreads 1"
            ) from error
        self.look()
        if not self._threads:
            found = ", ".join(sorted(set(self._refused.values())))
            raise ConfigError(
                f"no worker at {self.address} can be used: they have {found}, this is "
                f"{identity()}. Install the same everywhere."
            )

    def _ask(self, addresses: Iterable[str]) -> dict[str, str]:
        """What each has for this package; in words, if it has none."""
        asked = list(addresses)
        if not asked:
            return {}
        # What is run is found by any Python: a worker without the package can answer.
        found = self.client.run(eval, _ASK, workers=asked, on_error="return")
        return {
            address: f"no sfm-front ({answer})" if isinstance(answer, BaseException) else answer
            for address, answer in found.items()
        }


@contextmanager
def connected(options: ClusterOptions, note: Callable[[str], None]) -> Iterator[Cluster]:
    """The cluster, ready to work; ``note`` hears in one line each of what the user should know.

    Raises DependencyError without the extra; InputError if nothing answers at the address, or no
    worker is there; ConfigError if a worker has another package.
    """
    check_installed()
    import dask
    from distributed import Client

    _silence()
    with ExitStack() as opened:
        opened.enter_context(dask.config.set(_config(options)))
        target: Any = options.address
        if options.num_local is not None:
            target = opened.enter_context(_local_cluster(options.num_local))
        try:
            client = opened.enter_context(
                Client(target, timeout=_CONNECT_S, direct_to_workers=True, set_as_default=False)
            )
        except (OSError, ValueError) as error:
            raise InputError(
                f"{options.address}: no Dask scheduler answers there. Start one with dask "
                "scheduler, or give --cluster local:N."
            ) from error
        cluster = Cluster(client, client.scheduler.address, note)
        cluster.require_workers()
        yield cluster


def _silence() -> None:
    """Each death of a worker would be told with a traceback; ours is a line."""
    named = [name for name in logging.root.manager.loggerDict if name.startswith("distributed.")]
    for name in ("distributed", "tornado", *named):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def _config(options: ClusterOptions) -> dict[str, Any]:
    """Of this process, and of the scheduler and workers that it starts."""
    config: dict[str, Any] = {
        "distributed.scheduler.worker-ttl": _SILENT,
        # Deaths of workers in a task before it is given up, one less than attempts.
        "distributed.scheduler.allowed-failures": options.attempts - 1,
        "distributed.admin.tick.limit": "10 minutes",
    }
    if options.num_local is not None:
        config["distributed.comm.timeouts.connect"] = "10 minutes"
    return config


def _local_cluster(num_workers: int) -> Any:
    from distributed import LocalCluster

    # A process that is left at once cannot clean up after itself; what does so would say it.
    sys.warnoptions.append("ignore:resource_tracker")
    return LocalCluster(
        n_workers=num_workers,
        threads_per_worker=1,
        processes=True,
        preload=["sfm_front.cluster.preload"],
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        silence_logs=logging.CRITICAL,
    )
