"""Make the guides' pictures of the live page and the report: python scripts/make_screenshots.py.

FOLDER holds photos (default: the sample). Needs the extra test and the system's Chromium, which
draws by the processor. Takes a minute on two cores.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sample_scene.strangers import add_strangers

ROOT = Path(__file__).resolve().parents[1]
_CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
_FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--ignore-gpu-blocklist")
_SIZE = {"width": 1400, "height": 860}
_QUALITY = 82
_MARGIN_PX = 14
# While a session runs: once so many of its photos are placed.
_SHARE_PLACED = 0.7


def main() -> int:
    """Reconstruct with the page on, and take pictures of it on the way and at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    sample = ROOT / "data_samples" / "village" / "images"
    parser.add_argument("folder", type=Path, nargs="?", default=sample)
    parser.add_argument("--out", type=Path, default=ROOT / "sfm_front" / "guides" / "images")
    arguments = parser.parse_args()
    if _CHROMIUM is None:
        parser.error("needs chromium: apt-get install chromium")
    arguments.out.mkdir(parents=True, exist_ok=True)
    count = len(list(arguments.folder.iterdir()))
    with TemporaryDirectory(prefix="sfm_front_screenshots_") as folder, _browser() as browser:
        output = Path(folder) / arguments.folder.absolute().parent.name
        command = ["reconstruct.py", str(arguments.folder), "--output", str(output), "--viewer"]
        with _running(command) as address:
            tab = _tab(browser, address)
            _wait(tab, lambda: _num_placed(tab) >= _SHARE_PLACED * count)
            _take(tab, arguments.out / "live_running.jpg")
            _wait(tab, lambda: "finished" in tab.inner_text("body"))
            tab.close()
        with _running(["view.py", str(output), "--web"]) as address:
            tab = _tab(browser, address)
            _wait(tab, lambda: "finished" in tab.inner_text("body"))
            _choose_photo(tab, place=count // 2)
            tab.get_by_role("tab", name="Times").click()
            _take(tab, arguments.out / "live_finished.jpg")
        report = browser.new_page(viewport=_SIZE, color_scheme="light")
        report.goto((output / "report.html").as_uri())
        _take(report, arguments.out / "report.jpg")
        _take_part(report, arguments.out / "report_map.jpg", "#map > .columns")
        _show_unplaced(browser, arguments.folder, Path(folder), arguments.out)
    return 0


def _show_unplaced(browser: Any, photos: Path, folder: Path, out: Path) -> None:
    """What the report has of photos without a place, of which the sample has none of its own."""
    mixed, output = folder / "mixed", folder / "mixed_output"
    shutil.copytree(photos, mixed)
    add_strangers(mixed)
    script = [sys.executable, str(ROOT / "scripts" / "reconstruct.py"), str(mixed)]
    subprocess.run([*script, "--output", str(output), "--quiet"], check=True)
    report = browser.new_page(viewport=_SIZE, color_scheme="light", device_scale_factor=2)
    report.goto((output / "report.html").as_uri())
    report.add_style_tag(content="h3 { width: max-content }")  # Else it is as wide as the page.
    _take_part(report, out / "report_unplaced.jpg", "#unplaced h3, #unplaced .card")


@contextmanager
def _browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=_CHROMIUM, args=_FLAGS)
        yield browser
        browser.close()


@contextmanager
def _running(command: list[str]) -> Iterator[str]:
    """The address that a script of ours prints; it is ended with the block."""
    script = [sys.executable, str(ROOT / "scripts" / command[0]), *command[1:]]
    process = subprocess.Popen(script, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        found = (re.search(r"http://[\d.:]+", line) for line in process.stdout)
        yield next(match[0] for match in found if match is not None)
        process.terminate()
    finally:
        process.wait()


def _tab(browser: Any, address: str) -> Any:
    tab = browser.new_page(viewport=_SIZE, color_scheme="dark")
    # On a slow machine it would draw more and more coarsely.
    tab.goto(f"{address}?fixedDpr=1")
    return tab


def _wait(tab: Any, what: Any) -> None:
    while not what():
        tab.wait_for_timeout(200)


def _num_placed(tab: Any) -> int:
    match = re.search(r"(\d+) / \d+", tab.inner_text("body"))
    return 0 if match is None else int(match[1])


def _choose_photo(tab: Any, place: int) -> None:
    """From the list, as by a click on its camera; the first entry is no photo."""
    _close_notes(tab)
    tab.locator("input[aria-haspopup='listbox']:visible").first.click()
    tab.get_by_role("option").nth(place + 1).click()


def _take(tab: Any, file: Path) -> None:
    _close_notes(tab)
    tab.screenshot(path=file, type="jpeg", quality=_QUALITY)
    print(f"wrote {file}: {file.stat().st_size / 1000:.0f} kB")


def _take_part(page: Any, file: Path, selector: str) -> None:
    """All that is selected, with a margin."""
    boxes = [one.bounding_box() for one in page.locator(selector).all()]
    left, top = (min(box[side] for box in boxes) - _MARGIN_PX for side in ("x", "y"))
    right = max(box["x"] + box["width"] for box in boxes) + _MARGIN_PX
    bottom = max(box["y"] + box["height"] for box in boxes) + _MARGIN_PX
    part = {"x": left, "y": top, "width": right - left, "height": bottom - top}
    page.screenshot(path=file, type="jpeg", quality=_QUALITY, full_page=True, clip=part)
    print(f"wrote {file}: {file.stat().st_size / 1000:.0f} kB")


def _close_notes(tab: Any) -> None:
    """That the processor draws is no news here."""
    tab.wait_for_timeout(3000)  # Until they have come.
    buttons = "document.querySelectorAll('.mantine-Notification-closeButton')"
    tab.evaluate(f"{buttons}.forEach(button => button.click())")
    tab.wait_for_timeout(1000)  # Until they have gone.


if __name__ == "__main__":
    raise SystemExit(main())
