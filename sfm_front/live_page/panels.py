"""The panel that all browsers show: figures, the newest photo, lists, times, what is drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from sfm_front.live_page import photo_words, time_chart, words
from sfm_front.live_page.follower import Seen
from sfm_front.live_page.markup_parts import note
from sfm_front.live_page.photo_pictures import PhotoPictures
from sfm_front.live_page.scene_drawing import SceneDrawing

_WIDTH_PX = 400
_NEWEST_PX = 480
_LIGHT, _DARK = "light", "dark"
_ABOUT_TIMES = "Seconds of work a photo, by stage; reading and features run ahead."


class MainPanel:
    """``on_change`` is called when what is drawn was chosen anew, ``on_show_all`` with a browser
    that wants to see all of the scene again."""

    def __init__(
        self,
        server: viser.ViserServer,
        drawing: SceneDrawing,
        pictures: PhotoPictures,
        on_change: Callable[[], None],
        on_show_all: Callable[[viser.ClientHandle], None],
    ) -> None:
        gui = server.gui
        self._pictures = pictures
        self._newest: str | None = None
        self._headline = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Now"):
            self._picture = gui.add_image(np.full((3, 4, 3), 128, np.uint8), visible=False)
            self._about = gui.add_html("")
            self._events = gui.add_html("")
        with tabs.add_tab("Photos"):
            self._photos = gui.add_html("")
        with tabs.add_tab("Gaps"):
            self._gaps = gui.add_html("")
        with tabs.add_tab("Times"):
            gui.add_html(str(note(_ABOUT_TIMES)))
            self._times = gui.add_uplot(
                time_chart.columns([]),
                time_chart.series(),
                height=300,
                scales={"x": {"time": False}},
            )
        with tabs.add_tab("View"):
            self._legend = gui.add_html("")
            _add_choices(gui, drawing, on_change, on_show_all)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(_WIDTH_PX)

    def show(self, seen: Seen) -> None:
        """Change what has changed."""
        self._headline.content = str(words.headline(seen))
        self._about.content = str(words.newest(seen))
        self._events.content = str(words.events(seen))
        self._photos.content = str(photo_words.photo_list(seen))
        self._gaps.content = str(photo_words.gaps(seen))
        self._legend.content = str(words.legend(seen))
        added = [photo for photo in seen.story.photos.values() if photo.seconds]
        self._times.data = time_chart.columns(added)
        self._show_newest(seen)

    def show_time(self, seen: Seen) -> None:
        """Time passes where nothing else happens."""
        self._headline.content = str(words.headline(seen))

    def _show_newest(self, seen: Seen) -> None:
        newest = seen.story.newest
        name = None if newest is None else newest.name
        if name == self._newest:
            return
        picture = None if name is None else self._pictures.upright(name, _NEWEST_PX)
        if picture is not None:
            self._picture.image = picture
        self._picture.visible = picture is not None
        self._newest = name


def _add_choices(
    gui: viser.GuiApi,
    drawing: SceneDrawing,
    on_change: Callable[[], None],
    on_show_all: Callable[[viser.ClientHandle], None],
) -> None:
    show_all = gui.add_button("Show all")
    size = gui.add_slider("Point size", min=0.2, max=4.0, step=0.1, initial_value=1.0)
    frusta = gui.add_checkbox("Cameras", True)
    links = gui.add_checkbox("Links of the newest, weak links", True)
    all_links = gui.add_checkbox("All links", False)
    colours = gui.add_button_group("Colours", (_LIGHT, _DARK))

    def see_all(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        if event.client is not None:
            on_show_all(event.client)

    def choose_colours(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
        if event.client is not None:
            set_theme(event.client.gui, dark=colours.value == _DARK)

    def choose(_: object) -> None:
        drawing.point_scale = size.value
        drawing.shows_frusta, drawing.shows_links = frusta.value, links.value
        drawing.shows_all_links = all_links.value
        on_change()

    show_all.on_click(see_all)
    colours.on_click(choose_colours)
    for choice in (size, frusta, links, all_links):
        choice.on_update(choose)


def set_theme(gui: viser.GuiApi, *, dark: bool) -> None:
    """Of one browser, or of all; nothing of the page can be shared beyond this machine."""
    gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False)
