"""``reconstruct --cluster``: a cluster for one run, and the line about all its workers."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from sfm_front.cli.progress import ProgressLine
from sfm_front.cluster.options import ClusterOptions, check_installed
from sfm_front.reports.words import clock, counted
from sfm_front.runtime.closeable import Closeable

if TYPE_CHECKING:
    from sfm_front.cluster.coordinator import ClusterProgress
    from sfm_front.session.given import GivenSession
    from sfm_front.session.summing_up import SessionResult
    from sfm_front.types import PhotoPath


class ClusterRun(Closeable):
    """Connects, or starts workers on this machine, which end with it."""

    def __init__(self, arguments: argparse.Namespace, progress: ProgressLine) -> None:
        """Raises a SfmFrontError if there is no such cluster, or it cannot be used."""
        given = {} if arguments.group_size is None else {"group_size": arguments.group_size}
        self._options = ClusterOptions(address=arguments.cluster, **given)
        self._progress = progress
        self._opened = ExitStack()
        check_installed()
        from sfm_front.cluster.connection import connected

        self._cluster = self._opened.enter_context(connected(self._options, progress.keep))
        page = f", dashboard: {self._cluster.dashboard}" if self._cluster.dashboard else ""
        workers = counted(self._cluster.num_threads(), "worker")
        progress.note(f"{workers} at {self._cluster.address}{page}")

    def reconstruct(
        self,
        session: GivenSession,
        photos: Sequence[PhotoPath],
        is_stopped: Callable[[], bool],
    ) -> tuple[SessionResult, int]:
        """The result, and how many of the photos are in it or were skipped."""
        from sfm_front.cluster.coordinator import Coordinator

        coordinator = Coordinator(session, self._cluster, self._options, photos, self._show)
        if not coordinator.is_shared:
            self._progress.note("workers do not see the output's folder: features are sent")
        result = coordinator.run(is_stopped)
        return result, coordinator.num_taken

    def _show(self, now: ClusterProgress) -> None:
        self._progress.say(in_words(now))

    def close(self) -> None:
        self._opened.close()


def in_words(now: ClusterProgress) -> str:
    """On one line."""
    if now.num_groups:
        what = (
            f"{now.num_grown} of {counted(now.num_groups, 'group')} grown, {now.num_placed} photos "
            "placed"
        )
    else:
        what = (
            f"{now.num_described} of {now.num_photos} photos described, {now.num_matched} matched"
        )
    left = "" if now.seconds_left is None else f"  {clock(now.seconds_left)} left"
    busy = min(now.num_under_way, now.num_workers)
    return f"{what}; {busy} of {counted(now.num_workers, 'worker')} busy{left}"
