"""Pieces of markup that are used in several places beside the scene."""

from __future__ import annotations

from sfm_front.live_page import palette
from sfm_front.live_page.follower import Outcome, Seen
from sfm_front.reports.html.markup import Html, tag
from sfm_front.reports.story import PhotoState
from sfm_front.reports.words import counted

SCROLL = "max-height:52vh;overflow:auto;font-size:.82em"
ROW = "display:flex;gap:.5em;padding:.18em 0;border-bottom:1px solid rgba(128,134,145,.18)"
NAME = "flex:0 1 9.5em;overflow:hidden;text-overflow:ellipsis;white-space:nowrap"
PADDED = "padding:.5em .8em;font-size:.85em;line-height:1.45"


def what_became(seen: Seen, outcome: Outcome) -> str:
    if outcome.state is PhotoState.PLACED and outcome.model is not None:
        photo = outcome.photo
        by = f", matches {counted(len(photo.links), 'photo')}" if photo.links else ""
        where = "placed"
        if len(seen.models) > 1:
            where = f"in model {seen.models[outcome.model].model_id}"
        return where + by
    reason = f": {outcome.reason}" if outcome.reason else ""
    return f"{outcome.state.value}{reason}"


def dot(color: palette.Color, words: object) -> Html:
    mark = (
        "display:inline-block;width:.65em;height:.65em;border-radius:50%;margin-right:.4em;"
        f"background:{palette.css(color)}"
    )
    return tag("span", tag("span", style=mark), words)


def note(words: str) -> Html:
    """A sentence above a drawing."""
    return tag("div", words, style=PADDED)
