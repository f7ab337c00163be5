"""What a model looks like, from three sides."""

from __future__ import annotations

from collections.abc import Sequence

import pycolmap

from sfm_front.reports.html import SCENE_FILE
from sfm_front.reports.html.markup import Html, figure, joined, picture, section, tag
from sfm_front.reports.html.material import Material
from sfm_front.reports.html.observations import Observations
from sfm_front.reports.html.splatting import draw_scene
from sfm_front.viewers.model_drawing import build_scene
from sfm_front.viewers.viewpoint import choose_view

_SIZE = (760, 500)
# Caption, degrees to the right of the cameras' heading and above the horizon.
_FIRST = ("from behind the cameras and above", 28.0, 30.0)
_SIDES = (("from the left", 75.0, 10.0), ("from above", 0.0, 88.0))
# Of models after the largest, so many have a picture.
_MOST_OTHERS = 4


def model_pictures(material: Material) -> tuple[Html, Html] | None:
    """The largest model, and a section: from two more sides, and other models from one.

    None without a model.
    """
    if material.observations is None:
        return None
    link = _scene_link(material)
    first, *sides = _drawn(material.models[0], material.observations, [_FIRST, *_SIDES], link)
    others = [_other(material, number) for number in range(1, len(material.models))[:_MOST_OTHERS]]
    columns = tag("div", joined([*sides, *others]), class_="columns")
    return first, section("model", "Model", columns)


def _other(material: Material, number: int) -> Html:
    model = material.models[number]
    name = f"model {number}, {model.num_reg_images()} photos, {_FIRST[0]}"
    (drawn,) = _drawn(model, material.observations_in(number), [(name, *_FIRST[1:])])
    return drawn


def _scene_link(material: Material) -> Html | None:
    if not material.has_scene:
        return None
    return tag("a", "turn it in the browser", href=SCENE_FILE)


def _drawn(
    model: pycolmap.Reconstruction,
    observations: Observations,
    sides: Sequence[tuple[str, float, float]],
    link: Html | None = None,
) -> list[Html]:
    """A figure for each side; ``link`` follows the first caption."""
    scene = build_scene(model)
    width, height = _SIZE
    figures: list[Html] = []
    for caption, azimuth_deg, elevation_deg in sides:
        view = choose_view(
            scene.points,
            scene.vertices,
            observations.world_from_cam,
            observations.centres,
            width / height,
            azimuth_deg=azimuth_deg,
            elevation_deg=elevation_deg,
        )
        address = picture(draw_scene(scene, view, _SIZE))
        image = tag("img", src=address, alt=f"the model {caption}", width=width, height=height)
        says = joined([caption[0].upper() + caption[1:], None if figures else link], by=": ")
        figures.append(figure(image, says, class_="model"))
    return figures
