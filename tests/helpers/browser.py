"""The system's Chromium, without a screen, for tests of pages."""

from __future__ import annotations

import importlib.util
import io
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, NAMES)), None)
PATIENCE_S = 40.0

needs_chromium = [
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium: apt-get install chromium"),
    *(
        pytest.mark.skipif(
            importlib.util.find_spec(name) is None, reason=f"needs {name}: pip install {name}"
        )
        for name in ("playwright", "viser")
    ),
]

# Drawn by the processor: no graphics card is needed.
_FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--ignore-gpu-blocklist")


@contextmanager
def chromium() -> Iterator[Any]:
    """A running browser, as playwright has it."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=_FLAGS)
        yield browser
        browser.close()


class Tab:
    """A tab with a profile of its own; ``complaints``: errors that it told of."""

    def __init__(
        self,
        browser: Any,
        address: str,
        size: tuple[int, int] = (1000, 500),
        scheme: str = "dark",
    ) -> None:
        """``scheme``: what its user prefers, light or dark."""
        viewport = {"width": size[0], "height": size[1]}
        self.page = browser.new_context(viewport=viewport, color_scheme=scheme).new_page()
        self.complaints: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on(
            "console",
            lambda message: message.type == "error" and self.complaints.append(message.text),
        )
        # On a slow machine it would draw more and more coarsely.
        self.page.goto(f"{address}?fixedDpr=1")

    @property
    def text(self) -> str:
        """All that can be read."""
        return str(self.page.inner_text("body"))

    def picture(self) -> np.ndarray:
        """(h, w, 3) float64 of the tab."""
        return np.array(Image.open(io.BytesIO(self.page.screenshot())).convert("RGB"), float)

    def wait_for(self, what: Callable[[], bool]) -> None:
        """Until it is so; fails after a minute."""
        until = time.monotonic() + PATIENCE_S
        while not what():
            assert time.monotonic() < until, "waited in vain"
            # Not asleep: the browser is listened to meanwhile.
            self.page.wait_for_timeout(300)

    def close(self) -> None:
        self.page.context.close()
