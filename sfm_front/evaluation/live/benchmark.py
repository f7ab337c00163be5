"""Sends the photos of a scene to a watched folder while a session in another process takes them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.live.camera import send_photos
from sfm_front.evaluation.live.timeline import Timeline, read_timeline
from sfm_front.evaluation.process import measure
from sfm_front.reports.event_log import FILE
from sfm_front.types import PhotoPath

IDLE_TIMEOUT_S = 8.0
"""So long after the last photo the session ends."""


def run_live(
    command: Sequence[str], photos: Sequence[PhotoPath], workspace: Path, interval_s: float
) -> Timeline:
    """Send photos to the empty folder ``workspace/watched``, one each ``interval_s`` seconds.

    ``command`` starts ``reconstruct``; its arguments for watching are appended. The first photo is
    sent once it watches. ``workspace`` then holds its ``output`` and ``log.txt``. Raises
    InputError if it fails, ConfigError if it would end between two photos.
    """
    if not 0 <= interval_s < IDLE_TIMEOUT_S:
        raise ConfigError(
            f"the interval must be at least 0 and below {IDLE_TIMEOUT_S:g} s, got {interval_s}"
        )
    watched, output, log = (workspace / name for name in ("watched", "output", "log.txt"))
    watched.mkdir(parents=True)
    ended = Event()
    with ThreadPoolExecutor(1, "camera") as camera:
        sending = camera.submit(_send_when_ready, photos, watched, output / FILE, interval_s, ended)
        try:
            measured = measure(
                [
                    *command,
                    str(watched),
                    *("--output", str(output)),
                    *("--watch", "--idle-timeout", str(IDLE_TIMEOUT_S)),
                ],
                log,
            )
        finally:
            ended.set()
    complete = sending.result()
    if measured.return_code or len(complete) < len(photos):
        raise InputError(
            f"it took {len(complete)} of {len(photos)} photos and ended with status "
            f"{measured.return_code}: {measured.last_line}"
        )
    return read_timeline(complete, (output / FILE).read_text("utf-8").splitlines())


def _send_when_ready(
    photos: Sequence[PhotoPath], folder: Path, events: Path, interval_s: float, ended: Event
) -> dict[str, float]:
    # Its first line says that the session is open.
    while not (events.is_file() and events.stat().st_size):
        if ended.wait(0.02):
            return {}
    return send_photos(photos, folder, interval_s, ended)
