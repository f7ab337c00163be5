"""One run of ``reconstruct`` that is struck at a moment."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from sfm_front.evaluation.crashes.faults import Fault, strike
from sfm_front.evaluation.crashes.oracle import events
from sfm_front.runtime.subprocess_env import module_environment
from sfm_front.storage.database import DATABASE

_POLL_S = 0.0005
# Longer than any step of the scenes tried: a run that hangs is a violation, not a hang of ours.
_PATIENCE_S = 600.0
_PHOTO_EVENTS = {"photo_arrived", "photo_added", "photo_skipped"}


class Aim(Enum):
    """What a strike waits for once its time has come."""

    NOTHING = "nothing"
    WRITE = "the database grows"
    EXPORT = "models are written"


class Phase(Enum):
    """What a run was doing when it was struck, as far as its files tell."""

    START = "start-up"
    RECOVERY = "recovery"
    PHOTOS = "photos"
    WRITING = "writing a photo"
    REFINING = "last refinement"
    EXPORTING = "exporting"


@dataclass(frozen=True)
class Moment:
    """``fault``, ``after_s`` seconds from the start of the process, then as ``aim`` has it.

    ``room_bytes`` is for a full disk.
    """

    after_s: float
    fault: Fault
    aim: Aim = Aim.NOTHING
    room_bytes: int = 0


@dataclass(frozen=True)
class Outcome:
    """How a run ended: ``phase`` None if before its moment; ``num_restored`` photos were there
    when it began, None if it did not come that far."""

    phase: Phase | None
    status: int
    printed: str
    num_restored: int | None
    wall_seconds: float


def run(command: Sequence[str], output: Path, num_photos: int, moment: Moment | None) -> Outcome:
    """Run ``command``, which writes to ``output``, and strike it.

    ``num_photos``: how many there are in all. Raises subprocess.TimeoutExpired if it hangs.
    """
    sessions = sum(event["event"] == "session_started" for event in events(output))
    started = time.monotonic()
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        # A pipe, which the limit of a full disk does not touch.
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env=module_environment(),
        # What runs in the background of a script starts with Ctrl-C ignored, and hands that on.
        preexec_fn=_heed_ctrl_c,
    ) as process:
        try:
            phase = None
            if moment is not None and _await(process, output, started, moment):
                phase = _phase(output, sessions, num_photos, moment.aim)
                strike(process, moment.fault, moment.room_bytes)
            printed, _ = process.communicate(timeout=_PATIENCE_S)
        except BaseException:
            process.kill()
            raise
    begun = [event for event in events(output) if event["event"] == "session_started"]
    return Outcome(
        phase,
        process.returncode,
        printed,
        begun[-1]["num_photos"] if len(begun) > sessions else None,
        time.monotonic() - started,
    )


def _heed_ctrl_c() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _await(process: subprocess.Popen[str], output: Path, started: float, moment: Moment) -> bool:
    """Whether the moment came while the process ran."""
    wal, fresh = output / f"{DATABASE}-wal", output / "sparse.new"
    before = -1
    while process.poll() is None:
        if time.monotonic() - started >= moment.after_s:
            if before < 0:
                before = _size(wal)
            if (
                moment.aim is Aim.NOTHING
                or (moment.aim is Aim.WRITE and _size(wal) > before)
                or (moment.aim is Aim.EXPORT and fresh.exists())
            ):
                return True
        time.sleep(_POLL_S)
    return False


def _size(file: Path) -> int:
    try:
        return file.stat().st_size
    except OSError:
        return 0


def _phase(output: Path, sessions: int, num_photos: int, aim: Aim) -> Phase:
    if (output / "sparse.new").exists():
        return Phase.EXPORTING
    if aim is Aim.WRITE:
        return Phase.WRITING
    told = events(output)
    begun = [i for i, event in enumerate(told) if event["event"] == "session_started"]
    if len(begun) <= sessions:
        return Phase.START
    last = begun[-1]
    ours = {event["event"] for event in told[last:]}
    taken = {e["name"] for e in told if e["event"] in ("photo_added", "photo_skipped")}
    if told[last]["num_photos"] and not ours & _PHOTO_EVENTS and len(taken) < num_photos:
        return Phase.RECOVERY
    return Phase.REFINING if len(taken) >= num_photos else Phase.PHOTOS
