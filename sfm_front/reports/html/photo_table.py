"""What became of each photo, a row each."""

from __future__ import annotations

from sfm_front.reports.html.markup import Html, section, table, tag
from sfm_front.reports.html.material import Material
from sfm_front.reports.run_summary import Outcome
from sfm_front.types import Skipped

# Longer tables are folded.
_OPEN = 60

_HEAD = (
    "photo",
    "state",
    "most relevant image",
    "keypoints",
    "matched",
    "in points",
    "pairs",
    "seconds",
)


def photo_table(material: Material) -> Html | None:
    """None without photos."""
    photos = material.summary.photos
    if not photos:
        return None
    seen = material.observations.points_seen if material.observations else {}
    rows = [_row(material, photo, seen) for photo in photos]
    content = table(_HEAD, rows, numbers_from=3)
    return section(
        "photos",
        "All photos",
        tag(
            "details",
            tag("summary", f"{len(photos)} photos in order of arrival"),
            content,
            open="" if len(photos) <= _OPEN else None,
        ),
        tag(
            "p",
            "Keypoints that verified pairs match, that belong to points of the largest model; "
            "verified pairs with other photos; seconds of work, all stages.",
            class_="note",
        ),
    )


def _row(material: Material, photo: Outcome, seen: dict[int, int]) -> list[object]:
    if isinstance(photo, Skipped):
        return [photo.name, _state("unused", str(photo)), *[None] * (len(_HEAD) - 2)]
    model = photo.model
    state = (
        _state("missing", photo.why_not or "in no model")
        if model is None
        else _state("placed", "in the model")
        if model == 0
        else _state("other", f"in model {model}")
    )
    return [
        photo.name,
        state,
        photo.most_relevant,
        photo.num_keypoints,
        material.session.num_matched.get(photo.image_id),
        seen.get(photo.image_id),
        material.num_pairs.get(photo.image_id, photo.num_verified),
        f"{sum(photo.seconds.values()):.2f}",
    ]


def _state(kind: str, words: str) -> Html:
    return tag("span", words, class_=f"state {kind}")
