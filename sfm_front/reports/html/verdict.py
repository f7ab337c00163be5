"""Is it any good: a light for each thing that is looked at first, below each other."""

from __future__ import annotations

from collections.abc import Sequence

from sfm_front.reports import lights
from sfm_front.reports.html.markup import Html, joined, tag
from sfm_front.reports.html.material import Material
from sfm_front.reports.lights import Light
from sfm_front.reports.verdict import judged


def all_lights(material: Material) -> list[Light]:
    """In order of weight; what nothing is known of is left out, but for focal lengths."""
    photos, *others = judged(material.summary, material.sidecar)
    used = [photo.image_id for photo in material.summary.used]
    matches = lights.matches(
        [material.session.num_matched.get(image_id, 0) for image_id in used],
        [material.num_pairs.get(image_id, 0) for image_id in used],
    )
    return [photos, matches, *others]


def as_list(found: Sequence[Light]) -> Html:
    """Markup of lights; a level is a class of the style sheet."""
    return tag(
        "ul",
        joined(
            tag(
                "li",
                tag(
                    "i",
                    class_=f"light {light.level.value}",
                    role="img",
                    aria_label=light.level.value,
                ),
                tag("b", light.name),
                tag("span", light.value, class_="value"),
                tag("small", light.words),
            )
            for light in found
        ),
        class_="lights",
    )
