"""``scene.html``: the models to turn in any browser, in one file, without a network."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from pathlib import Path

import viser

from sfm_front.errors import InputError
from sfm_front.live_page.address import HOST
from sfm_front.live_page.browser_view import set_first_view
from sfm_front.live_page.follower import OutputFollower, Seen
from sfm_front.live_page.scene_drawing import SceneDrawing
from sfm_front.live_page.scenery import SceneMaker
from sfm_front.reports.html import SCENE_FILE
from sfm_front.reports.html.markup import Html, tag
from sfm_front.reports.standing import Standing
from sfm_front.reports.words import counted, day_and_hour
from sfm_front.storage.atomic import write_atomically

_CAPTION = (
    "position:fixed;left:0;bottom:0;padding:.5em .9em;font:13px system-ui,sans-serif;"
    "color:#c9d1db;background:rgba(14,18,23,.72);border-top-right-radius:6px;pointer-events:none"
)
_AS_OF = {
    Standing.RUNS: "as far as it was at",
    Standing.FINISHED: "finished at",
    Standing.STOPPED: "stopped at",
    Standing.BROKEN_OFF: "broken off at",
}


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
    page = page.replace("</body>", f"{_caption(output, seen)}</body>", 1)
    file = output / SCENE_FILE
    write_atomically(file, lambda new: new.write(page.encode()))
    return file


def _caption(output: Path, seen: Seen) -> Html:
    """What it shows, and of when: the file does not change any more."""
    num_photos = sum(len(shape.names) for shape in seen.models)
    num_points = sum(shape.num_points for shape in seen.models)
    said = f"{output.resolve().name}: {counted(num_photos, 'photo')}, {num_points} points"
    if seen.story.began is not None:
        said += f", {_AS_OF[seen.standing]} {day_and_hour(seen.story.last)}"
    return tag("div", said, style=_CAPTION)
