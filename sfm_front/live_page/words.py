"""What stands beside the scene, as markup: figures, lists, reasons.

All text is escaped: photos are called whatever their makers like.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence

from sfm_front.live_page import palette
from sfm_front.live_page.follower import Outcome, Seen
from sfm_front.live_page.story import PhotoState
from sfm_front.reports.html.markup import Html, joined, tag
from sfm_front.reports.words import clock, counted

# Rows of a list; more would take a browser longer than a second to lay out.
_MOST_ROWS = 300
_MOST_EVENTS = 14
# A session that is this silent may be gone.
_SILENT_S = 60.0

_TILE = "flex:1 1 5em;padding:.45em .6em;border-radius:.4em;background:rgba(128,134,145,.12)"
_BIG = "font-size:1.25em;font-weight:600;line-height:1.2;white-space:nowrap"
_SMALL = "font-size:.75em;opacity:.72"
_SCROLL = "max-height:52vh;overflow:auto;font-size:.82em"
_ROW = "display:flex;gap:.5em;padding:.18em 0;border-bottom:1px solid rgba(128,134,145,.18)"
_NAME = "flex:0 1 9.5em;overflow:hidden;text-overflow:ellipsis;white-space:nowrap"
_PADDED = "padding:.5em .8em;font-size:.85em;line-height:1.45"


def headline(seen: Seen, now: float | None = None) -> Html:
    """How far the session is, in figures; ``now``: seconds since 1970."""
    story = seen.story
    placed = seen.named(PhotoState.PLACED)
    taken = [one for one in seen.outcomes.values() if one.state is not PhotoState.ARRIVED]
    num_points = sum(shape.num_points for shape in seen.models)
    tiles = [
        _tile(f"{len(placed)} / {len(taken)}", "photos placed"),
        _tile(f"{num_points:,}".replace(",", "\N{THIN SPACE}"), "points"),
        _tile(str(len(seen.models)), "model" if len(seen.models) == 1 else "models"),
    ]
    recent = [sum(one.photo.seconds.values()) for one in taken if one.photo.seconds][-20:]
    if recent:
        tiles.append(_tile(f"{sorted(recent)[len(recent) // 2]:.2f} s", "a photo"))
    waiting, skipped = seen.named(PhotoState.WAITING), seen.named(PhotoState.SKIPPED)
    queued = seen.named(PhotoState.ARRIVED)
    notes = [
        _dot(palette.WAITING, f"{counted(len(waiting), 'photo')} waiting") if waiting else None,
        _dot(palette.WEAK, f"{len(seen.weak)} weakly held") if seen.weak else None,
        _dot(palette.FAINT, f"{len(skipped)} not used") if skipped else None,
        _dot(palette.FAINT, f"{len(queued)} to come") if queued and story.ended is None else None,
    ]
    return tag(
        "div",
        tag("div", _status(seen, time.time() if now is None else now), style="margin-bottom:.5em"),
        tag("div", *tiles, style="display:flex;flex-wrap:wrap;gap:.4em"),
        tag(
            "div",
            *notes,
            style="display:flex;flex-wrap:wrap;gap:.2em 1em;margin-top:.5em;font-size:.85em",
        ),
        style="padding:.6em .8em .4em",
    )


def _status(seen: Seen, now: float) -> Html:
    story = seen.story
    if story.began is None or story.last is None:
        return tag("b", "a model" if seen.models else "waiting for a session to begin …")
    lasted = clock(story.last - story.began)
    if story.ended is True:
        return joined([_dot(palette.LINK, tag("b", "finished")), f" after {lasted}"])
    if story.ended is False:
        return joined([_dot(palette.WAITING, tag("b", "stopped")), f" after {lasted}"])
    silent_s = now - story.last
    if silent_s > _SILENT_S:
        return joined(
            [_dot(palette.WEAK, tag("b", "running")), f", nothing new for {clock(silent_s)}"]
        )
    return joined([_dot(palette.NEWEST, tag("b", "running")), f" for {clock(now - story.began)}"])


def legend(seen: Seen) -> Html:
    """What the colours of cameras and lines mean."""
    models = [
        _dot(
            palette.of_model(place),
            "placed" if len(seen.models) < 2 else f"model {seen.models[place].model_id}",
        )
        for place in range(min(max(len(seen.models), 1), len(palette.MODELS)))
    ]
    return tag(
        "div",
        *models,
        _dot(palette.NEWEST, "newest"),
        _dot(palette.WEAK, "held by few others"),
        _dot(palette.WAITING, "others wait here"),
        _dot(palette.LINK, "matched with the newest"),
        style="display:flex;flex-wrap:wrap;gap:.1em .9em;padding:.5em .8em;font-size:.8em",
    )


def newest(seen: Seen) -> Html:
    """The newest photo, and what it matches."""
    photo = seen.story.newest
    if photo is None:
        return tag("div", "No photo yet.", style=_PADDED)
    outcome = seen.outcomes[photo.name]
    best = sorted(photo.links, key=lambda name: -photo.links[name])
    return tag(
        "div",
        tag("b", photo.name),
        f" {_what_became(seen, outcome)}",
        tag("br"),
        f"{photo.num_keypoints} keypoints; best matches: " if best else "",
        ", ".join(best[:4]),
        style=_PADDED,
    )


def events(seen: Seen) -> Html:
    """What became of models, the latest first."""
    rows = [
        tag(
            "div",
            tag("span", time.strftime("%H:%M:%S", time.localtime(at)), style="opacity:.6"),
            tag("span", words),
            style=_ROW,
        )
        for at, words in reversed(seen.story.lines[-_MOST_EVENTS:])
    ]
    return tag("div", *rows, style=f"{_PADDED};{_SCROLL};max-height:24vh")


def photo_list(seen: Seen) -> Html:
    """Each photo and what became of it, the latest first; of many, all that are not placed."""
    outcomes = list(seen.outcomes.values())
    shown = outcomes[-_MOST_ROWS:]
    early = [one for one in outcomes[:-_MOST_ROWS] if one.state is not PhotoState.PLACED]
    left_out = len(outcomes) - len(shown) - len(early)
    rows = [_row(seen, one) for one in reversed([*early[-_MOST_ROWS:], *shown])]
    more = tag("div", f"and {left_out} more that are placed") if left_out else None
    return tag("div", tag("div", *rows, more, style=_SCROLL), style="padding:.5em .8em")


def gaps(seen: Seen) -> Html:
    """Where photos are missing: those that wait, and those that few others hold."""
    waiting, weak = seen.named(PhotoState.WAITING), seen.weak
    parts: list[Html] = []
    if waiting:
        parts.append(tag("b", f"{counted(len(waiting), 'photo')} in no model"))
        parts += [_gap(one, _near(one)) for one in waiting[:_MOST_ROWS]]
    if weak:
        few = f"{counted(len(weak), 'photo')} that fewer than {seen.story.few_pairs} others hold"
        parts.append(tag("b", few))
        parts += [_gap(one, _held_by(one)) for one in weak[:_MOST_ROWS]]
    if len(seen.models) > 1:
        sizes = ", ".join(str(len(shape.image_ids)) for shape in seen.models)
        parts.append(
            tag(
                "div",
                f"{len(seen.models)} models of {sizes} photos: take photos between them that show "
                "parts of both.",
            )
        )
    if not parts:
        parts.append(tag("div", "None: every photo is in one model, and several others hold it."))
    return tag("div", tag("div", *parts, style=_SCROLL), style="padding:.5em .8em")


def photo_figures(
    seen: Seen, outcome: Outcome, pairs: Sequence[tuple[str, int]], num_observed: int
) -> Html:
    """Of one photo: what became of it, and the others that it matches, by inliers."""
    photo = outcome.photo
    rows: list[tuple[str, object]] = [("state", _what_became(seen, outcome))]
    if photo.num_keypoints:
        rows.append(("keypoints", photo.num_keypoints))
    if num_observed:
        rows.append(("sees points", num_observed))
    if photo.latency_s is not None:
        rows.append(("arrival to pose", f"{photo.latency_s:.1f} s"))
    if photo.seconds:
        rows.append(("work", f"{sum(photo.seconds.values()):.2f} s"))
    if photo.similar:
        rows.append(("most similar", ", ".join(photo.similar[:3])))
    figures = [
        tag("div", tag("span", label, style=f"{_NAME};opacity:.7"), tag("span", value), style=_ROW)
        for label, value in rows
    ]
    most = max((count for _, count in pairs), default=1)
    bars = [_bar(name, count, most) for name, count in pairs[:12]]
    title = tag("b", f"matches {counted(len(pairs), 'photo')}", style="display:block;margin:.5em 0")
    return tag("div", *figures, title if pairs else None, *bars, style=_PADDED)


def _bar(name: str, count: int, most: int) -> Html:
    width = f"width:{100 * count / most:.0f}%;background:rgba(34,197,94,.45);height:.7em"
    return tag(
        "div",
        tag("span", name, style=_NAME),
        tag("span", tag("span", style=f"display:block;{width}"), style="flex:1;align-self:center"),
        tag("span", count),
        style="display:flex;gap:.5em",
    )


def _row(seen: Seen, outcome: Outcome) -> Html:
    color = {
        PhotoState.PLACED: palette.WEAK
        if outcome.is_weak
        else palette.of_model(outcome.model or 0),
        PhotoState.WAITING: palette.WAITING,
    }.get(outcome.state, palette.FAINT)
    return tag(
        "div",
        tag("span", _dot(color, outcome.photo.name), style=_NAME, title=outcome.photo.name),
        tag("span", _what_became(seen, outcome), style="flex:1"),
        style=_ROW,
    )


def _gap(outcome: Outcome, where: str) -> Html:
    return tag(
        "div",
        tag("div", outcome.photo.name, style="font-weight:600;overflow-wrap:anywhere"),
        tag("div", where, style="overflow-wrap:anywhere;opacity:.85"),
        style="padding:.3em 0;border-bottom:1px solid rgba(128,134,145,.18)",
    )


def _near(outcome: Outcome) -> str:
    photo = outcome.photo
    linked = sorted(photo.links, key=lambda name: -photo.links[name])
    if outcome.hint:
        near = outcome.hint
    elif linked:
        near = f"matches {_listed(linked)}: take photos between"
    elif photo.similar:
        near = f"most similar are {_listed(photo.similar)}"
    else:
        near = "nothing to match it with yet"
    return "; ".join(filter(None, (outcome.reason, near)))


def _held_by(outcome: Outcome) -> str:
    links = outcome.photo.links
    return (
        f"held by {_listed(list(links))} alone" if links else "no other photo is known to hold it"
    )


def _listed(names: Iterable[str]) -> str:
    shown = list(names)
    return ", ".join(shown[:2]) + (" …" if len(shown) > 2 else "")


def _what_became(seen: Seen, outcome: Outcome) -> str:
    if outcome.state is PhotoState.PLACED and outcome.model is not None:
        photo = outcome.photo
        by = f", matches {counted(len(photo.links), 'photo')}" if photo.links else ""
        where = "placed"
        if len(seen.models) > 1:
            where = f"in model {seen.models[outcome.model].model_id}"
        return where + by
    reason = f": {outcome.reason}" if outcome.reason else ""
    return f"{outcome.state.value}{reason}"


def _tile(figure: str, label: str) -> Html:
    return tag("div", tag("div", figure, style=_BIG), tag("div", label, style=_SMALL), style=_TILE)


def _dot(color: palette.Color, words: object) -> Html:
    mark = (
        "display:inline-block;width:.65em;height:.65em;border-radius:50%;margin-right:.4em;"
        f"background:{palette.css(color)}"
    )
    return tag("span", tag("span", style=mark), words)


def note(words: str) -> Html:
    """A sentence above a drawing."""
    return tag("div", words, style=_PADDED)
