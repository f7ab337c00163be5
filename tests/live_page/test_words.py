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
from sfm_front.reports.story import PhotoState, PhotoStory, Story
from sfm_front.reports.verdict import Verdict


def seen(*, ended: bool | None = None, **counts: int) -> Seen:
    """So many photos in each state, with hostile names."""
    story, outcomes = Story(), {}
    story.began, story.last, story.ended = 1000.0, 1090.0, ended
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
    return Seen(story, [], [], outcomes)


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
    text = " ".join(text_of(words.headline(seen(PLACED=3, WAITING=2, ARRIVED=4), 1092.0)).split())
    assert "running for 1:32" in text
    assert "3 / 5 photos placed" in text
    assert "2 photos waiting" in text
    assert "3 weakly held" in text
    assert "4 to come" in text


@pytest.mark.parametrize(
    ("ended", "now", "expected"),
    [
        (True, 1092.0, "finished after 1:30"),
        (False, 1092.0, "stopped after 1:30"),
        (None, 1400.0, "running , nothing new for 5:10"),
    ],
)
def test_the_headline_says_how_it_stands(ended, now, expected):
    assert expected in " ".join(text_of(words.headline(seen(ended=ended), now)).split())


def test_the_headline_names_the_step_of_the_end():
    what = seen()
    what.story.step = "finishing 4 of 6: last adjustment"
    text = " ".join(text_of(words.headline(what, 1400.0)).split())
    assert "finishing 4 of 6: last adjustment for 5:10" in text


@pytest.mark.parametrize("level", [Level.GOOD, Level.FAIR, Level.BAD])
def test_the_verdict_is_text(level):
    judged = replace(seen(ended=True), verdict=Verdict(level, f"All are in. {HOSTILE}"))
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
            {"event": "session_ended", "finished": False},
            "session stopped; the same command goes on",
        ),
        ({"event": "photo_arrived", "name": "a.jpg"}, ""),
        ({"event": "of the future"}, ""),
    ],
)
def test_events_read_well(event, expected):
    assert in_words(event) == expected
