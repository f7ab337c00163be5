"""Markup out of parts, of which text is escaped unless it is markup already."""

from __future__ import annotations

import html
from base64 import b64encode
from collections.abc import Iterable
from io import BytesIO
from typing import TypeAlias

from PIL import Image


class Html(str):
    """Markup, as opposed to text that is still to be escaped."""

    __slots__ = ()


Child: TypeAlias = object
"""Markup, text, a number, or None for nothing."""

_VOID = frozenset({"br", "img", "meta", "hr", "link"})
# Control characters become the pictures that Unicode has of them. What turns the direction of
# writing would disguise a name; halves of surrogates, by which Python keeps bytes of file names
# that are not UTF-8, cannot be written.
_UNFIT = "\N{REPLACEMENT CHARACTER}"
_VISIBLE = {
    **{code: chr(0x2400 + code) for code in range(0x20) if chr(code) not in "\t\n"},
    0x7F: "\N{SYMBOL FOR DELETE}",
    **dict.fromkeys((*range(0x80, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A)), _UNFIT),
    **dict.fromkeys(range(0xD800, 0xE000), _UNFIT),
}


def visible(value: object) -> str:
    """Any text with all of it to be seen, and fit to be written."""
    return str(value).translate(_VISIBLE)


def escaped(value: object) -> Html:
    """Any text as it may stand between tags or in an attribute."""
    return value if isinstance(value, Html) else Html(html.escape(visible(value)))


def joined(children: Iterable[Child], by: str = "") -> Html:
    """Children one after the other; None is left out."""
    return Html(escaped(by).join(escaped(child) for child in children if child is not None))


def tag(name: str, /, *children: Child, **attributes: object) -> Html:
    """An element. Of attribute names, a last underscore goes and others become hyphens; those that
    are None are left out."""
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escaped(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in _VOID:
        return Html(f"<{name}{given}>")
    return Html(f"<{name}{given}>{joined(children)}</{name}>")


def section(anchor: str, title: str, *children: Child) -> Html:
    """A part of the page under a heading that can be linked to."""
    return tag("section", tag("h2", title), *children, id=anchor)


def figure(content: Html, caption: Child, **attributes: object) -> Html:
    """Content in a frame with a caption below."""
    return tag("figure", content, tag("figcaption", caption), **attributes)


def table(head: Iterable[Child], rows: Iterable[Iterable[Child]], *, numbers_from: int = 1) -> Html:
    """A table that scrolls sideways on its own; columns of numbers stand to the right."""
    titles = _cells("th", head, numbers_from)
    body = joined(tag("tr", _cells("td", row, numbers_from)) for row in rows)
    content = tag("table", tag("thead", tag("tr", titles)), tag("tbody", body))
    return tag("div", content, class_="scroll")


def picture(image: Image.Image, *, lossless: bool = False) -> str:
    """A picture as an address: WebP of photos and renderings, PNG of what has few colours."""
    buffer = BytesIO()
    if lossless:
        image.save(buffer, "PNG", optimize=True)
    else:
        image.save(buffer, "WEBP", quality=82, method=2)
    kind = "png" if lossless else "webp"
    return f"data:image/{kind};base64,{b64encode(buffer.getvalue()).decode()}"


def _cells(name: str, cells: Iterable[Child], numbers_from: int) -> Html:
    return joined(
        tag(name, "" if cell is None else cell, class_="number" if place >= numbers_from else None)
        for place, cell in enumerate(cells)
    )
