"""How a session stands, told by its events and by whether a process holds its folder."""

from __future__ import annotations

import pytest

from sfm_front.reports.standing import Standing, how_to_go_on, read_story, standing
from sfm_front.reports.story import Story
from sfm_front.storage.session_lock import SessionLock

LATER = 1e10


def story_of(**last: object) -> Story:
    """Of a session that began and, if more is given, ended so."""
    story = Story()
    time = "2026-11-30T12:00:00+00:00"
    options = {"second_look": {"min_pairs": 3}}
    command = "sfm-front reconstruct photos"
    story.tell(
        {
            "event": "session_started",
            "time": time,
            "options": options,
            "num_photos": 0,
            "command": command,
        }
    )
    if last:
        counts = {"num_photos": 4, "num_registered": 3, "num_models": 1}
        story.tell({"event": "session_ended", "time": time, **counts, **last})
    return story


@pytest.mark.parametrize(
    ("last", "expected"),
    [
        ({"finished": True}, Standing.FINISHED),
        ({"finished": True, "num_left": 0}, Standing.FINISHED),
        ({"finished": True, "num_left": 2}, Standing.STOPPED),
        ({"finished": False}, Standing.STOPPED),
    ],
)
def test_one_that_has_ended(tmp_path, last, expected):
    assert standing(story_of(**last), tmp_path, LATER) is expected


def test_without_an_end_it_runs_as_long_as_a_process_holds_it(tmp_path):
    story = story_of()
    with SessionLock(tmp_path):
        assert standing(story, tmp_path, LATER) is Standing.RUNS
    assert standing(story, tmp_path, LATER) is Standing.BROKEN_OFF


def test_one_that_goes_on_telling_runs_whatever_the_drive_says_of_its_lock(tmp_path):
    story = story_of()
    assert standing(story, tmp_path, (story.last or 0.0) + 1) is Standing.RUNS


def test_without_a_session_nothing_is_broken(tmp_path):
    story = read_story(tmp_path)
    assert not story.is_unfinished
    assert standing(story, tmp_path, LATER) is Standing.RUNS


def test_it_says_what_goes_on():
    assert how_to_go_on(story_of()) == "to go on:"
    assert how_to_go_on(Story()) == "the same command goes on."


def test_one_that_goes_on_has_nothing_left_of_its_end():
    story = story_of(finished=True, num_left=2)
    assert not story.is_unfinished
    story.tell(
        {
            "event": "session_started",
            "time": "2026-11-30T13:00:00+00:00",
            "options": {"second_look": {"min_pairs": 3}},
            "num_photos": 4,
        }
    )
    assert story.is_unfinished
    assert story.num_left == 0
