"""How a session stands: whether it runs, and if not, how it ended and what goes on with it."""

from __future__ import annotations

import time
from enum import Enum
from pathlib import Path

from sfm_front.reports import event_log
from sfm_front.reports.event_tail import EventTail
from sfm_front.reports.story import Story
from sfm_front.storage.session_lock import is_locked

# A drive may hide the lock of another machine's session, but not that this goes on telling.
_SILENT_S = 3.0


class Standing(Enum):
    """``STOPPED``: before its end, or with photos to go. ``BROKEN_OFF``: it has told of no end, and
    no process works on it."""

    RUNS = "runs"
    FINISHED = "finished"
    STOPPED = "stopped"
    BROKEN_OFF = "broken off"


def read_story(output: Path) -> Story:
    """What a session has told so far; nothing where there has been none."""
    story = Story()
    for event in EventTail(output / event_log.FILE).new()[0]:
        story.tell(event)
    return story


def standing(story: Story, output: Path, now: float | None = None) -> Standing:
    """How the session of ``output`` stands that has told this; ``now``: seconds since 1970."""
    if story.ended is not None:
        return Standing.FINISHED if story.ended and not story.num_left else Standing.STOPPED
    silent_s = (time.time() if now is None else now) - (story.last or 0.0)
    is_alone = story.began is not None and silent_s > _SILENT_S and not is_locked(output)
    return Standing.BROKEN_OFF if is_alone else Standing.RUNS


def how_to_go_on(story: Story) -> str:
    """The end of a sentence, after which its command follows where that is known."""
    return "to go on:" if story.command else "the same command goes on."
