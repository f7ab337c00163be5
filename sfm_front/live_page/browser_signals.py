"""What a browser tells that viser has no messages for: clicks on rows, dark or light, how it draws.

viser's markup cannot call back. A number that nobody sees can: at a click, a browser writes to it.
Rows say which photo they are of by a number, never by its name.
"""

from __future__ import annotations

from collections.abc import Callable

import viser

from sfm_front.reports.html.markup import Html, tag

_NOTHING = -1
# Whether a browser prefers dark, and whether it has a graphics card to draw with.
_MANNERS = {-2: (True, True), -3: (False, True), -4: (True, False), -5: (False, False)}
_PLACE = "sfm-front-signal"
# React hears of a value only if it is set as if typed.
_SIGNAL = (
    f"const field = document.getElementById(document.getElementById('{_PLACE}')?.dataset.field);"
    "if (field && signal !== undefined) {"
    "Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value')"
    ".set.call(field, signal);"
    "field.dispatchEvent(new Event('input', {bubbles: true})); }"
)
_ON_CLICK = f"const signal = event.target.closest('[data-photo]')?.dataset.photo; {_SIGNAL}"
_ON_LOAD = (
    "const dark = matchMedia('(prefers-color-scheme: dark)');"
    "const gl = document.createElement('canvas').getContext('webgl');"
    "const card = gl?.getExtension('WEBGL_debug_renderer_info');"
    "const name = card ? gl.getParameter(card.UNMASKED_RENDERER_WEBGL) : '';"
    # That of Windows is called Microsoft Basic Render Driver.
    "const slow = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);"
    "gl?.getExtension('WEBGL_lose_context')?.loseContext();"
    "const tell = () => {"
    f" const signal = -2 - (dark.matches ? 0 : 1) - (slow ? 2 : 0); {_SIGNAL} }};"
    # The field may still be on its way into the page.
    "setTimeout(tell, 0); dark.addEventListener('change', tell);"
)
_ROW = "cursor:pointer"


def clickable(*rows: object, style: str) -> Html:
    """A list whose rows of ``photo_row`` open their photo."""
    return tag("div", *rows, style=style, onclick=_ON_CLICK)


def photo_row(number: int, *content: object, style: str) -> Html:
    """A row for the photo of this number, in order of arrival from 0 on."""
    return tag("div", *content, style=f"{style};{_ROW}", data_photo=number)


class BrowserSignals:
    """Hears one browser."""

    def __init__(
        self,
        client: viser.ClientHandle,
        on_photo: Callable[[int], None],
        on_manner: Callable[[bool, bool], None],
    ) -> None:
        """``on_photo`` is called with the number of a photo whose row was clicked, ``on_manner``
        with whether the browser prefers dark, and whether it draws with a graphics card: at first,
        and whenever that changes."""
        self._on_photo, self._on_manner = on_photo, on_manner
        self._field = client.gui.add_number("", _NOTHING, step=1)
        self._field.on_update(lambda _: self._hear(int(self._field.value)))
        client.gui.add_html(str(_hidden(self._field._impl.uuid)))

    def _hear(self, signal: int) -> None:
        if signal == _NOTHING:
            return
        # That the same row can be clicked again.
        self._field.value = _NOTHING
        if signal in _MANNERS:
            self._on_manner(*_MANNERS[signal])
        elif signal >= 0:
            self._on_photo(signal)


def _hidden(field: str) -> Html:
    """Says which field it is, hides it, and runs once it is in the page."""
    style = f'div:has(> div > div > p > label[for="{field}"]) {{ display: none }}'
    return tag(
        "div",
        tag("span", id=_PLACE, data_field=field),
        tag("style", Html(style), onload=_ON_LOAD),
    )
