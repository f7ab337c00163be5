"""The live page in a real browser: what is drawn, clicked and said, and that no name does harm."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
from helpers.browser import Tab, chromium, needs_chromium
from helpers.live_session import HOSTILE, orbit, photos_of, run_session
from helpers.positioned_stream import options

from sfm_front.live_page.beside_session import PageBesideSession
from sfm_front.reports.html.markup import visible
from sfm_front.session import snapshots
from sfm_front.session.session import Session
from sfm_front.storage.session_lock import SessionLock

NUM_PHOTOS = 10
NAMES = {3: HOSTILE}
# Cameras of the largest model, and those that few others hold.
BLUE, ORANGE = (59, 130, 246), (249, 115, 22)

pytestmark = [pytest.mark.slow, *needs_chromium]


class Served:
    """A page of an output, kept up to date in a thread."""

    def __init__(self, output: Any) -> None:
        from sfm_front.live_page.server import LivePage

        self.page = LivePage(output, 18080)
        self._ended = Event()
        self._thread = Thread(target=self.page.run, args=(self._ended.is_set,))
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self.page.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as running:
        yield running


@pytest.fixture(scope="module")
def served(tmp_path_factory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("live")
    output = run_session(folder / "out", photos_of(orbit(NUM_PHOTOS), folder / "photos", NAMES))
    served = Served(output)
    yield served
    served.close()


@pytest.fixture(scope="module")
def tab(browser, served) -> Iterator[Tab]:
    tab = Tab(browser, served.page.address)
    tab.wait_for(lambda: "finished" in tab.text)
    tab.wait_for(lambda: count(tab, BLUE) > 100)
    yield tab
    tab.close()


def count(tab: Tab, color: tuple[int, int, int]) -> int:
    """Pixels of the scene that are nearly of this colour; beside it are panels."""
    return int((np.abs(tab.picture()[:, :600] - color).max(axis=-1) < 40).sum())


def colored(tab: Tab) -> int:
    """Pixels of the scene that differ from its background."""
    picture = tab.picture()[100:, 50:600]
    return int((np.ptp(picture, axis=-1) > 12).sum())


def place_of(served: Served, name: str) -> tuple[float, float]:
    """Where the first browser shows the camera of a photo."""
    from viser.transforms import SO3

    _, scenery = served.page._state
    camera = next(iter(served.page._server.get_clients().values())).camera
    cameras, index = scenery.cameras, scenery.cameras.names.index(name)
    ahead = 0.7 * cameras.sizes[index][2] * cameras.rotations[index][:, 2]
    x, y, z = SO3(camera.wxyz).as_matrix().T @ (cameras.centres[index] + ahead - camera.position)
    focal = camera.image_height / 2 / np.tan(camera.fov / 2)
    return focal * x / z + camera.image_width / 2, focal * y / z + camera.image_height / 2


def chosen(tab: Tab) -> list[str]:
    """What stands in the tab's fields, the list of photos among them."""
    return tab.page.evaluate("[...document.querySelectorAll('input')].map(field => field.value)")


def show(tab: Tab, title: str) -> None:
    tab.page.get_by_role("tab", name=title).click()


def test_it_says_how_the_session_went(tab):
    assert f"{NUM_PHOTOS} / {NUM_PHOTOS}" in tab.text
    assert f"finished: {NUM_PHOTOS} of {NUM_PHOTOS} photos in 1 model" in tab.text


def test_points_and_cameras_are_drawn(tab, served):
    cameras = count(tab, BLUE)
    served.page._drawing.cameras.visible = served.page._drawing._frusta.visible = False
    tab.wait_for(lambda: count(tab, BLUE) < cameras / 10)
    points = colored(tab)
    served.page._drawing.points.visible = False
    tab.wait_for(lambda: colored(tab) < points / 2)
    served.page._is_stale.set()
    tab.wait_for(lambda: count(tab, BLUE) > cameras / 2)
    assert points > 100


def test_a_late_browser_shows_the_same_and_chooses_for_itself(browser, served, tab):
    late = Tab(browser, served.page.address)
    late.wait_for(lambda: "finished" in late.text)

    def look_alike() -> bool:
        # Neither may have drawn all of it yet.
        first, second = count(tab, BLUE), count(late, BLUE)
        return min(first, second) > 100 and abs(first - second) < 0.2 * first

    late.wait_for(look_alike)
    # The lowest in sight: no panel covers it.
    names = served.page._state[1].cameras.names
    name = max(names, key=lambda name: place_of(served, name)[1])
    x, y = place_of(served, name)

    def is_chosen() -> bool:
        tab.page.mouse.click(x, y)
        tab.page.wait_for_timeout(1000)
        return name in chosen(tab)

    tab.wait_for(is_chosen)
    tab.wait_for(lambda: "sees points" in tab.text)
    # Beside the newest photo: this one, and its matches with another.
    tab.wait_for(lambda: tab.page.locator("img:visible").count() == 3)
    assert late.page.locator("img:visible").count() == 1
    assert name not in chosen(late)
    late.close()
    assert late.complaints == []


def test_every_tab_is_filled(tab):
    for title, words in {
        "Photos": "000004.jpg",
        "Gaps": "several others hold it",
        "Times": "Seconds of work a photo",
        "View": "Point size",
        "Now": "best matches",
    }.items():
        show(tab, title)
        tab.wait_for(lambda words=words: words in tab.text)


def test_a_hostile_name_does_no_harm(tab, served):
    show(tab, "Photos")
    tab.wait_for(lambda: visible(HOSTILE) in tab.text)
    served.page._photo_panels[min(served.page._photo_panels)].open(HOSTILE)
    tab.wait_for(lambda: visible(HOSTILE) in chosen(tab))
    assert tab.page.evaluate("window.harm") is None
    assert tab.page.locator("img[src='x']").count() == 0


def test_a_click_on_a_row_opens_its_photo_here_alone(browser, served, tab):
    other = Tab(browser, served.page.address)
    for name in ("000006.jpg", HOSTILE, "000006.jpg"):
        show(tab, "Photos")
        row = tab.page.locator("[data-photo]", has_text=visible(name))
        tab.wait_for(lambda row=row: row.count() == 1)
        row.click()
        tab.wait_for(lambda name=name: visible(name) in chosen(tab))
    assert "000006.jpg" not in chosen(other)
    other.close()
    # What carries the click is not to be seen.
    assert not tab.page.locator("input[value='-1']").is_visible()


def brightness(tab: Tab) -> float:
    return float(np.median(tab.picture()[:, 700:]))


def test_colours_are_those_that_a_browser_prefers_or_its_user_chooses(browser, served, tab):
    light = Tab(browser, served.page.address, scheme="light")
    light.wait_for(lambda: "finished" in light.text)
    light.wait_for(lambda: brightness(light) > 200)
    assert brightness(tab) < 60
    light.page.emulate_media(color_scheme="dark")  # As in the evening.
    light.wait_for(lambda: brightness(light) < 60)
    show(light, "View")
    light.page.get_by_role("button", name="light").click()
    light.wait_for(lambda: brightness(light) > 200)
    assert brightness(tab) < 60
    light.close()
    assert light.complaints == []


def test_it_does_not_complain(tab):
    assert tab.complaints == []


def test_a_session_is_followed_while_it_runs(browser, tmp_path, monkeypatch):
    # Models are written after each photo, however long that takes.
    monkeypatch.setattr(snapshots, "_MAX_SHARE", math.inf)

    photos = list(photos_of(orbit(16), tmp_path / "photos", NAMES))
    served = Served(tmp_path / "out")
    tab = Tab(browser, served.page.address)
    tab.wait_for(lambda: "waiting for a session to begin" in tab.text)
    with Session(tmp_path / "out", options(snapshot_seconds=1e-9)) as session:
        for photo in photos[:10]:
            session.add_extracted(photo)
        tab.wait_for(lambda: "running" in tab.text and "/ 10" in tab.text)
        tab.wait_for(lambda: count(tab, BLUE) + count(tab, ORANGE) > 50)
        for photo in photos[10:]:
            session.add_extracted(photo)
        tab.wait_for(lambda: "/ 16" in tab.text)
        session.finish()
    tab.wait_for(lambda: "finished" in tab.text and count(tab, BLUE) > 50)
    assert tab.complaints == []
    tab.close()
    served.close()


def test_without_a_graphics_card_the_scene_waits_and_the_words_do_not(
    browser, tmp_path, monkeypatch
):
    from sfm_front.live_page import server

    monkeypatch.setattr(snapshots, "_MAX_SHARE", math.inf)
    photos = list(photos_of(orbit(16), tmp_path / "photos"))
    served = Served(tmp_path / "out")
    tab = Tab(browser, served.page.address)

    def num_drawn() -> int:
        state = served.page._state
        return 0 if state is None else len(state[1].cameras.names)

    tab.wait_for(lambda: len(served.page._slow) == 1)
    with Session(tmp_path / "out", options(snapshot_seconds=1e-9)) as session:
        for photo in photos[:10]:
            session.add_extracted(photo)
        tab.wait_for(lambda: "/ 10" in tab.text and num_drawn() == 10)
        monkeypatch.setattr(server, "_DRAWN_SLOWLY_EVERY_S", 1e9)
        for photo in photos[10:]:
            session.add_extracted(photo)
        tab.wait_for(lambda: "/ 16" in tab.text)
        session.finish()
    assert num_drawn() == 10
    monkeypatch.setattr(server, "_DRAWN_SLOWLY_EVERY_S", 1.0)
    tab.wait_for(lambda: num_drawn() == 16)
    tab.close()
    served.close()


def test_whoever_looks_reads_that_a_session_was_killed(browser, tmp_path):
    output = tmp_path / "out"
    run_session(output, photos_of(orbit(6), tmp_path / "photos"), finish=False)
    log = output / "events.jsonl"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[:-1]))  # It told of no end.
    said: list[str] = []
    with PageBesideSession(output, said.append, 18380) as page, SessionLock(output) as lock:
        while not said:
            assert page._process.poll() is None
            time.sleep(0.1)
        tab = Tab(browser, said[0].removeprefix("live page: "))
        tab.wait_for(lambda: "running" in tab.text and "/ 6" in tab.text)
        lock.close()
        page._process.stdin.close()  # As the system does.
        tab.wait_for(lambda: "broken off" in tab.text)
        assert "no process here works on it" in tab.text
        assert page._process.poll() is None
        tab.close()
        assert page._process.wait(60) == 0
