"""``reconstruct --cluster``: a cluster for one run, and the line about all its workers."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from typing import TYPE_CHECKING

from sfm_front.cli.progress import ProgressLine
from sfm_front.cluster.options import ClusterOptions, check_installed
from sfm_front.reports.words import clock, counted
from sfm_front.runtime.closeable import Closeable

if TYPE_CHECKING:
    from sfm_front.cluster.connection import Cluster
    from sfm_front.cluster.coordinator import ClusterProgress
    from sfm_front.session.given import GivenSession
    from sfm_front.session.summing_up import SessionResult
    from sfm_front.types import PhotoPath


class ClusterRun(Closeable):
    """Connects, or starts workers on this machine, which end with it. That takes seconds, and goes
    on beside whatever is done until ``ready``."""

    def __init__(self, arguments: argparse.Namespace, progress: ProgressLine) -> None:
        """Raises ConfigError for an address that is none, DependencyError without the extra."""
        given = {} if arguments.group_size is None else {"group_size": arguments.group_size}
        self._options = ClusterOptions(address=arguments.cluster, **given)
        self._progress = progress
        self._opened = ExitStack()
        check_installed()
        self._beside = ThreadPoolExecutor(1, "sfm-cluster")
        self._connecting = self._beside.submit(self._connect)

    def _connect(self) -> Cluster:
        from sfm_front.cluster.connection import connected

        return self._opened.enter_context(connected(self._options, self._progress.keep))

    def ready(self) -> None:
        """Wait for the first worker. Raises a SfmFrontError if there is no such cluster, or it
        cannot be used."""
        cluster = self._connecting.result()
        page = f", dashboard: {cluster.dashboard}" if cluster.dashboard else ""
        workers = counted(cluster.num_threads, "worker")
        self._progress.note(f"{workers} at {cluster.address}{page}")

    def reconstruct(
        self,
        session: GivenSession,
        photos: Sequence[PhotoPath],
        is_stopped: Callable[[], bool],
    ) -> tuple[SessionResult, int]:
        """The result, and how many of the photos are in it or were skipped."""
        from sfm_front.cluster.coordinator import Coordinator

        cluster = self._connecting.result()
        coordinator = Coordinator(session, cluster, self._options, photos, self._show)
        if not coordinator.is_shared:
            self._progress.note("workers do not see the output's folder: features are sent")
        result = coordinator.run(is_stopped)
        return result, coordinator.num_taken

    def _show(self, now: ClusterProgress) -> None:
        self._progress.say(in_words(now))

    def close(self) -> None:
        self._beside.shutdown()
        self._opened.close()


def in_words(now: ClusterProgress) -> str:
    """On one line."""
    if now.num_groups:
        joined = f", {now.num_joined} of {now.num_joins} joined" if now.num_joins else ""
        what = (
            f"{now.num_grown} of {counted(now.num_groups, 'group')} grown{joined}, "
            f"{counted(now.num_placed, 'photo')} placed"
        )
    else:
        what = (
            f"{now.num_described} of {now.num_photos} photos described, {now.num_matched} matched"
        )
    left = "" if now.seconds_left is None else f"  {clock(now.seconds_left)} left"
    busy = min(now.num_under_way, now.num_workers)
    return f"{what}; {busy} of {counted(now.num_workers, 'worker')} busy{left}"
