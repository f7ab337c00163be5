"""``scene.html``: the finished models to turn in any browser, in one file, without a network."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from pathlib import Path

import viser

from sfm_front.errors import InputError
from sfm_front.live_page.address import HOST
from sfm_front.live_page.browser_view import set_first_view
from sfm_front.live_page.follower import OutputFollower
from sfm_front.live_page.scene_drawing import SceneDrawing
from sfm_front.live_page.scenery import SceneMaker
from sfm_front.reports.html import SCENE_FILE
from sfm_front.reports.html.markup import tag
from sfm_front.storage.atomic import write_atomically


def write_scene(output: Path) -> Path:
    """Write it into ``output``; returns where.

    Raises InputError if there is no model in the output, or the file cannot be written.
    """
    seen = OutputFollower(output).look()
    if seen is None or not seen.models:
        raise InputError(f"{output}: holds no model: there is no scene to write")
    scenery = SceneMaker().make(seen)
    with redirect_stdout(io.StringIO()):  # It greets.
        server = viser.ViserServer(HOST, port=0, verbose=False)
    try:
        SceneDrawing(server.scene).show(scenery)
        set_first_view(server, scenery)
        page = server.scene.as_html(dark_mode=True)
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()
    title = tag("title", output.resolve().name)
    page = page.replace("<title>Viser</title>", title, 1)
    file = output / SCENE_FILE
    write_atomically(file, lambda new: new.write(page.encode()))
    return file
