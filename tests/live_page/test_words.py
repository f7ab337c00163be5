"""What stands beside the scene: right figures, and no markup but ours."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from helpers.live_session import HOSTILE

from sfm_front.live_page import photo_words, words
from sfm_front.live_page.follower import Outcome, Seen
from sfm_front.reports.event_words import in_words
from sfm_front.reports.lights import Level
from sfm_front.reports.standing import Standing
from sfm_front.reports.story import PhotoState, PhotoStory, Story
from sfm_front.reports.verdict import Verdict


def seen(stands: Standing = Standing.RUNS, **counts: int) -> Seen:
    """So many photos in each state, with hostile names."""
    story, outcomes = Story(), {}
    story.began, story.last = 1000.0, 1090.0
    for state in PhotoState:
        for number in range(counts.get(state.name, 0)):
            name = f"{state.name} {number} {HOSTILE}"
            photo = PhotoStory(name, state, seconds={"sift": 0.5}, similar=(HOSTILE,))
            photo.links = {HOSTILE: 3}
            outcomes[name] = Outcome(
                photo, state, None, HOSTILE, HOSTILE, is_weak=state is PhotoState.PLACED
            )
            story.newest = photo
            story.lines.append((1000.0, HOSTILE))
    return Seen(story, [], [], outcomes, standing=stands)


def text_of(markup: str) -> str:
    return re.sub(r"<[^>]*>", " ", markup)


@pytest.mark.parametrize(
    "part",
    [
        words.headline,
        words.newest,
        words.events,
        photo_words.photo_list,
        photo_words.gaps,
        words.legend,
    ],
)
def test_names_are_text(part):
    markup = part(seen(PLACED=2, WAITING=2, SKIPPED=1, ARRIVED=1, DESCRIBED=1))
    assert "<img" not in markup
    assert "\x1b" not in markup
    assert "\u202e" not in markup
    assert set(re.findall(r"<(\w+)", markup)) <= {"div", "span", "b", "br"}


def test_figures_of_one_photo_are_text():
    what = seen(WAITING=1)
    (outcome,) = what.outcomes.values()
    markup = photo_words.photo_figures(what, outcome, [(HOSTILE, 12)], 5)
    assert "<img" not in markup
    assert "12" in text_of(markup)


def test_the_headline_counts():
    text = " ".join(
        text_of(words.headline(seen(PLACED=3, WAITING=2, ARRIVED=4, SKIPPED=1), 1092.0)).split()
    )
    assert "running for 1:32" in text
    assert "3 / 5 photos placed" in text
    assert "2 photos waiting" in text
    assert "3 weakly held" in text
    assert "4 to come" in text


@pytest.mark.parametrize(
    ("stands", "now", "expected"),
    [
        (Standing.FINISHED, 1092.0, "finished after 1:30"),
        (Standing.STOPPED, 1092.0, "stopped after 1:30 the same command goes on"),
        (Standing.RUNS, 1400.0, "running , nothing new for 5:10"),
        (
            Standing.BROKEN_OFF,
            1400.0,
            "broken off after 1:30: nothing heard for 5:10, no process here works on it",
        ),
    ],
)
def test_the_headline_says_how_it_stands(stands, now, expected):
    assert expected in " ".join(text_of(words.headline(seen(stands), now)).split())


def test_of_a_stopped_session_it_says_what_is_left_and_what_goes_on():
    what = seen(Standing.STOPPED, ARRIVED=2)
    what.story.num_left, what.story.command = 7, f"sfm-front reconstruct '{HOSTILE}'"
    markup = words.headline(what)
    text = " ".join(text_of(markup).split())
    assert "stopped after 1:30 with 7 photos to go to go on: sfm-front reconstruct" in text
    assert "to come" not in text
    assert "<img" not in markup
    assert "\x1b" not in markup


def test_the_headline_names_the_step_of_the_end():
    what = seen()
    what.story.step = "finishing 4 of 6: last adjustment"
    text = " ".join(text_of(words.headline(what, 1400.0)).split())
    assert "finishing 4 of 6: last adjustment for 5:10" in text


@pytest.mark.parametrize("level", [Level.GOOD, Level.FAIR, Level.BAD])
def test_the_verdict_is_text(level):
    judged = replace(seen(Standing.FINISHED), verdict=Verdict(level, f"All are in. {HOSTILE}"))
    markup = words.headline(judged)
    assert "All are in." in text_of(markup)
    assert "<img" not in markup


def test_long_lists_keep_what_is_not_placed():
    markup = photo_words.photo_list(seen(WAITING=5, PLACED=400))
    assert markup.count("WAITING") >= 5
    assert "and 100 more that are placed" in text_of(markup)


@pytest.mark.parametrize(
    ("event", "expected"),
    [
        (
            {
                "event": "models_joined",
                "model_id": 1,
                "joined_model_id": 2,
                "num_registered": [8, 1],
            },
            "model 2 (1 photo) joined to model 1 (8)",
        ),
        (
            {
                "event": "session_ended",
                "finished": True,
                "num_photos": 3,
                "num_registered": 2,
                "num_models": 1,
                "num_left": 1,
            },
            "stopped with 1 photo to go, finished: 2 of 3 photos in 1 model",
        ),
        (
            {"event": "session_ended", "finished": False},
            "session stopped; the same command goes on",
        ),
        ({"event": "photo_arrived", "name": "a.jpg"}, ""),
        ({"event": "of the future"}, ""),
    ],
)
def test_events_read_well(event, expected):
    assert in_words(event) == expected
