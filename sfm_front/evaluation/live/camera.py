"""Copies photos into a folder one by one, as a camera that sends them would."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from threading import Event

from sfm_front.types import PhotoPath


def send_photos(
    photos: Sequence[PhotoPath], folder: Path, interval_s: float, stop: Event
) -> dict[str, float]:
    """Copy each photo under its name to ``folder``, ``interval_s`` after the one before it began.

    Returns name → when its copy was complete, in seconds of ``time.time``; of those copied before
    ``stop`` was set.
    """
    complete = {}
    began = time.monotonic()
    for number, photo in enumerate(photos):
        if stop.wait(max(0.0, began + number * interval_s - time.monotonic())):
            break
        target = folder / photo.name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(photo.path, target)
        complete[photo.name] = time.time()
    return complete
