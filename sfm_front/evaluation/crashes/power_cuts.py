"""What a power cut leaves: the write-ahead log of a run's database, cut anywhere.

A log is synced before it is moved into the database, so a cut can only hit what lies behind that.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sfm_front.evaluation.crashes.oracle import (
    Acknowledged,
    acknowledged,
    stored_photos,
    violations,
)
from sfm_front.evaluation.crashes.struck_run import run
from sfm_front.evaluation.crashes.wal import HEADER_BYTES, commit_ends, moved_until
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.reports.event_log import FILE as EVENTS
from sfm_front.runtime.subprocess_env import module_environment
from sfm_front.storage.database import DATABASE

_CUTS_PER_COPY = 5
_WAL, _SHARED_MEMORY = f"{DATABASE}-wal", f"{DATABASE}-shm"


@dataclass
class Cuts:
    """``in_frame``: cuts that are at no transaction's end; ``num_photos``: stored after each."""

    scene: str
    num_copies: int = 0
    in_frame: int = 0
    num_photos: list[int] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)


def cut_at_random(
    scene: BenchmarkScene,
    command: Sequence[str],
    output: Path,
    num_cuts: int,
    *,
    seed: int,
    note: Callable[[str], None],
) -> Cuts:
    """Copy the database in the middle of runs of ``command``, and cut each copy at random."""
    draw = np.random.default_rng(seed)
    whole = run(command, output, scene.num_photos, None)
    cuts = Cuts(scene.name)
    copy = output.with_name("copy")
    while len(cuts.num_photos) < num_cuts:
        shutil.rmtree(output, ignore_errors=True)
        after_s = float(draw.uniform(0.0, whole.wall_seconds))
        if not _copy_while_it_runs(command, output, copy, after_s):
            continue
        cuts.num_copies += 1
        ends = commit_ends(copy / _WAL)
        first = moved_until(copy / _WAL, copy / _SHARED_MEMORY)
        last = (copy / _WAL).stat().st_size
        # Offsets within the round: what lies behind it is of the round before.
        until = max(ends, default=HEADER_BYTES)
        for _ in range(min(_CUTS_PER_COPY, num_cuts - len(cuts.num_photos))):
            at = int(draw.integers(first, min(last, until + 1) + 1)) if until >= first else last
            found, num_photos = _cut(copy, at, ends)
            cuts.in_frame += at not in ends
            cuts.num_photos.append(num_photos)
            cuts.violations += found
            note(
                f"{len(cuts.num_photos)}/{num_cuts}  cut at {at} of {last}: "
                f"{num_photos} photos, {len(found)} violations"
            )
    return cuts


def _copy_while_it_runs(command: Sequence[str], output: Path, copy: Path, after_s: float) -> bool:
    """Whether there was a log to copy after so many seconds, all files as of one moment."""
    shutil.rmtree(copy, ignore_errors=True)
    copy.mkdir()
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=module_environment(),
    ) as process:
        try:
            started = time.monotonic()
            while process.poll() is None and time.monotonic() - started < after_s:
                time.sleep(0.01)
            if process.poll() is not None:
                return False
            process.send_signal(signal.SIGSTOP)
            os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
            there = (output / _WAL).exists() and (output / _WAL).stat().st_size > HEADER_BYTES
            for name in (DATABASE, _WAL, _SHARED_MEMORY, EVENTS):
                if there:
                    shutil.copyfile(output / name, copy / name)
        finally:
            process.kill()
    return there


def _cut(copy: Path, at: int, ends: Sequence[int]) -> tuple[list[str], int]:
    """Violations after the log of a copy is cut ``at`` an offset, and photos that are left."""
    told = {photo.image_id: photo for photo in acknowledged(copy)}
    whole = bisect_right(ends, at)
    # Cut there, nothing of a transaction is in doubt.
    reference = _stored(copy, ends[whole - 1] if whole else HEADER_BYTES)
    cut = _truncated(copy, at)
    try:
        stored = stored_photos(cut / DATABASE)
        must: list[Acknowledged] = [told[i] for i in reference if i in told]
        found = violations(cut, must)
        if stored != reference:
            found.append(f"cut at {at}: {len(stored)} photos, {len(reference)} were committed")
        if at >= max(ends, default=at) and (lost := told.keys() - stored.keys()):
            found.append(f"acknowledged, but not in the log: {sorted(lost)}")
        return found, len(stored)
    finally:
        shutil.rmtree(cut)


def _stored(copy: Path, at: int) -> dict[int, str]:
    cut = _truncated(copy, at)
    try:
        return stored_photos(cut / DATABASE)
    finally:
        shutil.rmtree(cut)


def _truncated(copy: Path, at: int) -> Path:
    cut = copy.with_name("cut")
    cut.mkdir()
    for name in (DATABASE, _WAL):
        shutil.copyfile(copy / name, cut / name)
    os.truncate(cut / _WAL, at)
    return cut


def format_cuts(cuts: Cuts) -> str:
    """What came of the cuts."""
    photos = cuts.num_photos
    lines = [
        f"{cuts.scene}: {len(photos)} cuts of {cuts.num_copies} copies, {cuts.in_frame} of them "
        f"within a transaction; {min(photos)} to {max(photos)} photos were left",
        f"violations: {len(cuts.violations)}",
    ]
    return "\n".join([*lines, *(f"  {violation}" for violation in cuts.violations)])
