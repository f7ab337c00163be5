"""The page itself: a server on this machine alone, and the loop that keeps it up to date."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from threading import Event, Lock

import numpy as np
import viser

from sfm_front.live_page.access import keep_private
from sfm_front.live_page.address import FIRST_PORT, HOST
from sfm_front.live_page.browser_signals import BrowserSignals
from sfm_front.live_page.browser_view import BrowserView, set_first_view
from sfm_front.live_page.follower import OutputFollower, Seen
from sfm_front.live_page.panels import MainPanel, set_theme
from sfm_front.live_page.photo_panel import PhotoPanel
from sfm_front.live_page.photo_pictures import PhotoPictures
from sfm_front.live_page.scene_drawing import SceneDrawing
from sfm_front.live_page.scenery import SceneMaker, Scenery
from sfm_front.reports.html.markup import visible
from sfm_front.runtime.closeable import Closeable
from sfm_front.storage.watched_mark import mark_watched, unmark_watched

_TICK_S = 0.25
# Of the time, at most this share goes into showing what is new; and it is shown at most so often.
_MOST_SHARE = 0.25
_SHOWN_EVERY_S = 1.0
# A change makes a browser draw for half a second. Without a graphics card that takes from a session
# on the same machine, so there the scene changes no more often than this.
_DRAWN_SLOWLY_EVERY_S = 5.0


class LivePage(Closeable):
    """Shows one output to any number of browsers."""

    def __init__(self, output: Path, port: int = FIRST_PORT) -> None:
        """The first free port from ``port`` on; ``address`` says which."""
        self._output = output
        self._follower = OutputFollower(output)
        self._maker = SceneMaker()
        self._lock = Lock()
        self._is_stale = Event()
        # The newest, and what is shown of it: a scene may be some seconds behind its words.
        self._newest: tuple[Seen, Scenery] | None = None
        self._state: tuple[Seen, Scenery] | None = None
        self._drawn_s = 0.0
        self._views: dict[int, BrowserView] = {}
        self._photo_panels: dict[int, PhotoPanel] = {}
        self._next_s = 0.0
        # Ids of browsers without a graphics card.
        self._slow: set[int] = set()
        with redirect_stdout(io.StringIO()):  # It greets.
            self._server = viser.ViserServer(HOST, port, label=_title(output), verbose=False)
        keep_private(self._server)
        set_theme(self._server.gui, dark=True)
        self._pictures = PhotoPictures(output)
        self._drawing = SceneDrawing(self._server.scene)
        self._panel = MainPanel(
            self._server, self._drawing, self._pictures, self._is_stale.set, self._show_all
        )
        self._drawing.cameras.on_click(self._open_clicked)
        self._server.on_client_connect(self._welcome)
        self._server.on_client_disconnect(self._see_off)

    @property
    def address(self) -> str:
        """Where browsers find it."""
        return f"http://{HOST}:{self._server.get_port()}"

    @property
    def num_browsers(self) -> int:
        """How many are connected."""
        return len(self._server.get_clients())

    def run(self, until: Callable[[], bool]) -> None:
        """Keep it up to date until ``until``; without a browser nothing is read or sent."""
        while not until():
            if self.num_browsers:
                mark_watched(self._output)
                self.update()
            time.sleep(_TICK_S)

    def update(self) -> None:
        """Show what is new, if it is time to."""
        now = time.monotonic()
        if now < self._next_s:
            return
        seen = self._follower.look()
        with self._lock:
            if seen is not None:
                self._newest = seen, self._maker.make(seen)
            if self._newest is None:
                return
            newest, scenery = self._newest
            drawn = None if self._state is None else self._state[1]
            is_due = now >= self._drawn_s + (_DRAWN_SLOWLY_EVERY_S if self._slow else 0.0)
            is_new = seen is not None
            if drawn is None or self._is_stale.is_set() or (is_due and drawn is not scenery):
                self._is_stale.clear()
                self._draw(scenery)
                drawn, is_new = scenery, True
            self._state = newest, drawn
            if is_new:
                self._tell(*self._state)
            else:
                self._panel.show_time(newest)
            for view in self._views.values():
                view.follow(drawn)
        spent = time.monotonic() - now
        self._next_s = now + max(_SHOWN_EVERY_S, spent / _MOST_SHARE)

    def close(self) -> None:
        unmark_watched(self._output)
        with redirect_stdout(io.StringIO()):  # It says goodbye.
            self._server.stop()

    def _tell(self, seen: Seen, scenery: Scenery) -> None:
        """In words and pictures, beside the scene."""
        with self._server.atomic():
            self._panel.show(seen)
        for panel in list(self._photo_panels.values()):
            panel.show(seen, scenery)

    def _draw(self, scenery: Scenery) -> None:
        self._drawn_s = time.monotonic()
        with self._server.atomic():
            self._drawing.show(scenery)
        set_first_view(self._server, scenery)

    def _welcome(self, client: viser.ClientHandle) -> None:
        panel = PhotoPanel(client, self._pictures)
        view = BrowserView(client, self._server.initial_camera.position)
        BrowserSignals(
            client,
            on_photo=lambda number: self._open_numbered(client.client_id, number),
            on_manner=lambda dark, has_card: self._suit(client, dark=dark, has_card=has_card),
        )
        with self._lock:
            self._views[client.client_id] = view
            self._photo_panels[client.client_id] = panel
            if self._state is not None:
                panel.show(*self._state)
                view.follow(self._state[1])

    def _suit(self, client: viser.ClientHandle, *, dark: bool, has_card: bool) -> None:
        set_theme(client.gui, dark=dark)
        with self._lock:
            if not has_card and client.client_id in self._views:
                self._slow.add(client.client_id)

    def _see_off(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._slow.discard(client.client_id)
            self._views.pop(client.client_id, None)
            self._photo_panels.pop(client.client_id, None)

    def _show_all(self, client: viser.ClientHandle) -> None:
        view = self._views.get(client.client_id)
        if view is not None and self._state is not None:
            view.follow(self._state[1], anyway=True)

    def _open_clicked(self, event: viser.SceneNodePointerEvent[viser.BatchedMeshHandle]) -> None:
        panel, state = self._photo_panels.get(event.client_id), self._state
        if panel is None or state is None:
            return
        # Browsers do not say which camera while the mouse has lit one up.
        cameras = state[1].cameras
        place = cameras.along(np.array(event.ray_origin), np.array(event.ray_direction))
        if place is not None:
            panel.open(cameras.names[place])

    def _open_numbered(self, client_id: int, number: int) -> None:
        """By the number of a row in a list."""
        panel, state = self._photo_panels.get(client_id), self._state
        names = [] if state is None else list(state[0].outcomes)
        if panel is not None and number < len(names):
            panel.open(names[number])


def _title(output: Path) -> str:
    return visible(output.absolute().name or "sfm_front")
