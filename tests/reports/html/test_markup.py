"""What is not markup is escaped, whatever it is."""

from __future__ import annotations

from base64 import b64decode
from io import BytesIO

import pytest
from PIL import Image

from sfm_front.reports.html.markup import Html, escaped, joined, picture, table, tag


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("<script>alert(1)</script>", "&lt;script&gt;alert(1)&lt;/script&gt;"),
        ("a\"b'c&d", "a&quot;b&#x27;c&amp;d"),
        ("bell\x07 esc\x1b[31m", "bell␇ esc␛[31m"),
        ("two\nlines", "two\nlines"),
        ("\x9b31m", "�31m"),
        ("\u202egpj.exe", "�gpj.exe"),
        ("not utf-8 \udcff", "not utf-8 �"),
        ("Bäume 森.jpg", "Bäume 森.jpg"),
        (3, "3"),
    ],
)
def test_text_becomes_harmless(text, shown):
    assert escaped(text) == shown
    escaped(text).encode()  # it can be written


def test_children_and_attributes_are_escaped_once():
    inner = tag("b", "<i>")
    assert inner == "<b>&lt;i&gt;</b>"
    assert tag("p", inner, "<", title='"', class_="x", id=None) == (
        '<p title="&quot;" class="x"><b>&lt;i&gt;</b>&lt;</p>'
    )
    assert tag("img", src="<", alt="") == '<img src="&lt;" alt="">'


def test_nothing_is_left_out_but_none():
    assert joined(["a", None, 0, Html("<br>")]) == "a0<br>"


def test_cells_of_tables_are_escaped():
    content = table(("<h>", "n"), [["<a>", None]])
    assert "<h>" not in content
    assert "<a>" not in content
    assert '<td class="number"></td>' in content


@pytest.mark.parametrize("lossless", [True, False])
def test_pictures_are_in_the_page(lossless):
    address = picture(Image.new("RGBA", (20, 10), (250, 0, 0, 255)), lossless=lossless)
    kind, data = address.removeprefix("data:image/").split(";base64,")
    read = Image.open(BytesIO(b64decode(data)))
    assert (kind, read.size) == ("png" if lossless else "webp", (20, 10))
    assert read.convert("RGB").getpixel((5, 5))[0] > 240
