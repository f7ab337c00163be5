"""Photos beside the scene, as markup: the list of all, the gaps, the figures of one.

All text is escaped: photos are called whatever their makers like.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from sfm_front.live_page import palette
from sfm_front.live_page.browser_signals import clickable, photo_row
from sfm_front.live_page.follower import Outcome, Seen
from sfm_front.live_page.markup_parts import NAME, PADDED, ROW, SCROLL, dot, what_became
from sfm_front.reports.html.markup import Html, tag
from sfm_front.reports.story import PhotoState
from sfm_front.reports.words import counted

# Rows of a list; more would take a browser longer than a second to lay out.
_MOST_ROWS = 300


def photo_list(seen: Seen) -> Html:
    """Each photo and what became of it, the latest first; of many, all that are not placed."""
    outcomes = list(enumerate(seen.outcomes.values()))
    shown = outcomes[-_MOST_ROWS:]
    early = [one for one in outcomes[:-_MOST_ROWS] if one[1].state is not PhotoState.PLACED]
    left_out = len(outcomes) - len(shown) - len(early)
    rows = [_row(seen, *one) for one in reversed([*early[-_MOST_ROWS:], *shown])]
    more = tag("div", f"and {left_out} more that are placed") if left_out else None
    return tag("div", clickable(*rows, more, style=SCROLL), style="padding:.5em .8em")


def gaps(seen: Seen) -> Html:
    """Where photos are missing: those that wait, and those that few others hold."""
    waiting, weak = seen.named(PhotoState.WAITING), seen.weak
    number_of = {name: number for number, name in enumerate(seen.outcomes)}

    def rows(outcomes: Sequence[Outcome], where: Callable[[Outcome], str]) -> list[Html]:
        return [_gap(number_of[one.photo.name], one, where(one)) for one in outcomes[:_MOST_ROWS]]

    parts: list[Html] = []
    if waiting:
        parts.append(tag("b", f"{counted(len(waiting), 'photo')} in no model"))
        parts += rows(waiting, _near)
    if weak:
        few = f"{counted(len(weak), 'photo')} that fewer than {seen.story.few_pairs} others hold"
        parts.append(tag("b", few))
        parts += rows(weak, _held_by)
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
    return tag("div", clickable(*parts, style=SCROLL), style="padding:.5em .8em")


def photo_figures(
    seen: Seen, outcome: Outcome, pairs: Sequence[tuple[str, int]], num_observed: int
) -> Html:
    """Of one photo: what became of it, and the others that it matches, by inliers."""
    photo = outcome.photo
    rows: list[tuple[str, object]] = [("state", what_became(seen, outcome))]
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
        tag("div", tag("span", label, style=f"{NAME};opacity:.7"), tag("span", value), style=ROW)
        for label, value in rows
    ]
    most = max((count for _, count in pairs), default=1)
    bars = [_bar(name, count, most) for name, count in pairs[:12]]
    title = tag("b", f"matches {counted(len(pairs), 'photo')}", style="display:block;margin:.5em 0")
    return tag("div", *figures, title if pairs else None, *bars, style=PADDED)


def _bar(name: str, count: int, most: int) -> Html:
    width = f"width:{100 * count / most:.0f}%;background:rgba(34,197,94,.45);height:.7em"
    return tag(
        "div",
        tag("span", name, style=NAME),
        tag("span", tag("span", style=f"display:block;{width}"), style="flex:1;align-self:center"),
        tag("span", count),
        style="display:flex;gap:.5em",
    )


def _row(seen: Seen, number: int, outcome: Outcome) -> Html:
    color = {
        PhotoState.PLACED: palette.WEAK
        if outcome.is_weak
        else palette.of_model(outcome.model or 0),
        PhotoState.WAITING: palette.WAITING,
    }.get(outcome.state, palette.FAINT)
    return photo_row(
        number,
        tag("span", dot(color, outcome.photo.name), style=NAME, title=outcome.photo.name),
        tag("span", what_became(seen, outcome), style="flex:1"),
        style=ROW,
    )


def _gap(number: int, outcome: Outcome, where: str) -> Html:
    return photo_row(
        number,
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
