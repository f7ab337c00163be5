"""How a session goes, as markup: figures, the newest photo, what became of models.

All text is escaped: photos are called whatever their makers like.
"""

from __future__ import annotations

import time

from sfm_front.live_page import palette
from sfm_front.live_page.follower import Seen
from sfm_front.live_page.markup_parts import PADDED, ROW, SCROLL, dot, what_became
from sfm_front.reports.html.markup import Html, joined, tag
from sfm_front.reports.standing import Standing, how_to_go_on
from sfm_front.reports.story import PhotoState
from sfm_front.reports.verdict import Verdict
from sfm_front.reports.words import clock, counted

_MOST_EVENTS = 14
# A session that is this silent is at something long.
_SILENT_S = 60.0

_TILE = "flex:1 1 5em;padding:.45em .6em;border-radius:.4em;background:rgba(128,134,145,.12)"
_BIG = "font-size:1.25em;font-weight:600;line-height:1.2;white-space:nowrap"
_ASIDE = "font-size:.82em;opacity:.8;overflow-wrap:anywhere;margin-top:.2em"
_SMALL = "font-size:.75em;opacity:.72"


def headline(seen: Seen, now: float | None = None) -> Html:
    """How far the session is, in figures; ``now``: seconds since 1970."""
    placed = seen.named(PhotoState.PLACED)
    not_taken = (PhotoState.ARRIVED, PhotoState.SKIPPED)
    taken = [one for one in seen.outcomes.values() if one.state not in not_taken]
    num_points = sum(shape.num_points for shape in seen.models)
    tiles = [
        _tile(f"{len(placed)} / {len(taken)}", "photos placed"),
        _tile(f"{num_points:,}".replace(",", "\N{THIN SPACE}"), "points"),
        _tile(str(len(seen.models)), "model" if len(seen.models) == 1 else "models"),
    ]
    recent = [sum(one.photo.seconds.values()) for one in taken if one.photo.seconds][-20:]
    if recent:
        tiles.append(_tile(f"{sorted(recent)[len(recent) // 2]:.2f} s", "work a photo"))
    waiting, skipped = seen.named(PhotoState.WAITING), seen.named(PhotoState.SKIPPED)
    queued, runs = seen.named(PhotoState.ARRIVED), seen.standing is Standing.RUNS
    notes = [
        dot(palette.WAITING, f"{counted(len(waiting), 'photo')} waiting") if waiting else None,
        dot(palette.WEAK, f"{len(seen.weak)} weakly held") if seen.weak else None,
        dot(palette.FAINT, f"{len(skipped)} not used") if skipped else None,
        dot(palette.FAINT, f"{len(queued)} to come") if queued and runs else None,
    ]
    return tag(
        "div",
        tag("div", _status(seen, time.time() if now is None else now), style="margin-bottom:.5em"),
        _verdict(seen.verdict),
        tag("div", *tiles, style="display:flex;flex-wrap:wrap;gap:.4em"),
        tag(
            "div",
            *notes,
            style="display:flex;flex-wrap:wrap;gap:.2em 1em;margin-top:.5em;font-size:.85em",
        ),
        style="padding:.6em .8em .4em",
    )


def _verdict(found: Verdict | None) -> Html | None:
    if found is None:
        return None
    says = dot(palette.OF_LEVEL[found.level], found.sentence)
    return tag("div", says, style="margin-bottom:.6em;font-size:.85em;line-height:1.4")


def _status(seen: Seen, now: float) -> Html:
    story = seen.story
    if story.began is None or story.last is None:
        return tag("b", "a model" if seen.models else "waiting for a session to begin …")
    lasted = clock(story.last - story.began)
    silent_s = now - story.last
    if seen.standing is Standing.FINISHED:
        return joined([dot(palette.LINK, tag("b", "finished")), f" after {lasted}"])
    if seen.standing is Standing.STOPPED:
        left = f" with {counted(story.num_left, 'photo')} to go" if story.num_left else ""
        said = [dot(palette.WEAK, tag("b", "stopped")), f" after {lasted}{left}", _go_on(seen)]
        return joined(said)
    if seen.standing is Standing.BROKEN_OFF:
        told = f" after {lasted}: nothing heard for {clock(silent_s)}, no process here works on it"
        return joined([dot(palette.WAITING, tag("b", "broken off")), told, _go_on(seen)])
    if story.step:
        # In one step there may be nothing to tell for minutes.
        return dot(palette.NEWEST, joined([tag("b", story.step), f" for {clock(silent_s)}"]))
    if silent_s > _SILENT_S:
        return joined(
            [dot(palette.WEAK, tag("b", "running")), f", nothing new for {clock(silent_s)}"]
        )
    return joined([dot(palette.NEWEST, tag("b", "running")), f" for {clock(now - story.began)}"])


def _go_on(seen: Seen) -> Html:
    command = tag("code", seen.story.command) if seen.story.command else None
    return tag("div", how_to_go_on(seen.story), " ", command, style=_ASIDE)


def legend(seen: Seen) -> Html:
    """What the colours of cameras and lines mean."""
    models = [
        dot(
            palette.of_model(place),
            "placed" if len(seen.models) < 2 else f"model {seen.models[place].model_id}",
        )
        for place in range(min(max(len(seen.models), 1), len(palette.MODELS)))
    ]
    return tag(
        "div",
        *models,
        dot(palette.NEWEST, "newest"),
        dot(palette.WEAK, "held by few others"),
        dot(palette.WAITING, "others wait here"),
        dot(palette.LINK, "matched with the newest"),
        style="display:flex;flex-wrap:wrap;gap:.1em .9em;padding:.5em .8em;font-size:.8em",
    )


def newest(seen: Seen) -> Html:
    """The newest photo, and what it matches."""
    photo = seen.story.newest
    if photo is None:
        return tag("div", "No photo yet.", style=PADDED)
    outcome = seen.outcomes[photo.name]
    best = sorted(photo.links, key=lambda name: -photo.links[name])
    return tag(
        "div",
        tag("b", photo.name),
        f" {what_became(seen, outcome)}",
        tag("br"),
        f"{photo.num_keypoints} keypoints; best matches: " if best else "",
        ", ".join(best[:4]),
        style=PADDED,
    )


def events(seen: Seen) -> Html:
    """What became of models, the latest first."""
    rows = [
        tag(
            "div",
            tag("span", time.strftime("%H:%M:%S", time.localtime(at)), style="opacity:.6"),
            tag("span", words),
            style=ROW,
        )
        for at, words in reversed(seen.story.lines[-_MOST_EVENTS:])
    ]
    return tag("div", *rows, style=f"{PADDED};{SCROLL};max-height:24vh")


def _tile(figure: str, label: str) -> Html:
    return tag("div", tag("div", figure, style=_BIG), tag("div", label, style=_SMALL), style=_TILE)
