"""Photos that are in no model, and files that were not used: what they show, and why not."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO

from sfm_front.reports.html.markup import Html, joined, section, tag
from sfm_front.reports.html.material import Material
from sfm_front.types import SkipReason
from sfm_front.viewers.pictures import load

_THUMBNAIL_PX = 240
# Each costs some 15 kB and some hundredths of a second.
_MOST_THUMBNAILS = 150
# Those after are folded.
_OPEN = 30
# Files of these have nothing to show.
_NO_PICTURE = (
    SkipReason.NOT_AN_IMAGE,
    SkipReason.EMPTY_FILE,
    SkipReason.TRUNCATED,
    SkipReason.UNREADABLE,
)


def unplaced(material: Material) -> Html:
    """The section; it says so if there are none."""
    waiting = [photo for photo in material.summary.used if photo.model is None]
    skipped = material.summary.skipped
    room = _MOST_THUMBNAILS
    cards = []
    for place, photo in enumerate(waiting):
        reasons = [photo.why_not or "in no model", photo.hint, _nearest(photo.most_relevant)]
        cards.append(_card(material, photo.name, reasons, with_picture=place < room))
    room -= len(waiting)
    others = []
    for place, file in enumerate(skipped):
        with_picture = place < room and file.reason not in _NO_PICTURE
        others.append(_card(material, file.name, [str(file)], with_picture=with_picture))
    return section(
        "unplaced",
        "Photos that are in no model",
        _group(f"{len(waiting)} not registered", cards),
        _group(f"{len(skipped)} not used", others),
        None if cards or others else tag("p", "None: all are in a model."),
    )


def _group(title: str, cards: Sequence[Html]) -> Html | None:
    if not cards:
        return None
    shown, rest = cards[:_OPEN], cards[_OPEN:]
    folded = tag("details", tag("summary", f"{len(rest)} more"), _grid(rest)) if rest else None
    return joined([tag("h3", title), _grid(shown), folded])


def _grid(cards: Sequence[Html]) -> Html:
    return tag("div", joined(cards), class_="cards")


def _nearest(name: str | None) -> str:
    return f"most relevant image: {name}" if name else ""


def _card(material: Material, name: str, reasons: Sequence[str], *, with_picture: bool) -> Html:
    words = [tag("p", reason) for reason in reasons if reason]
    shown = _thumbnail(material, name) if with_picture else None
    return tag("article", shown, tag("h4", name), joined(words), class_="card")


def _thumbnail(material: Material, name: str) -> Html:
    """Of the photo as it is stored; grey with a reason if it cannot be read any more."""
    path = material.files.get(name)
    if path is None or not path.is_file():
        return tag("div", "the file is no longer there", class_="gone")
    picture = load(path, _THUMBNAIL_PX)
    buffer = BytesIO()
    picture.save(buffer, "JPEG", quality=80)
    address = f"data:image/jpeg;base64,{b64encode(buffer.getvalue()).decode()}"
    return tag("img", src=address, alt="", width=picture.width, height=picture.height)
