"""Runs of the command ``reconstruct``, and what happens in the middle of them."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from sfm_front.cli.main import main
from sfm_front.cli.progress import ProgressLine
from sfm_front.events import Event, PhotoAdded

# Less than is had at full size: what the tests need is a fair run that is quick.
SMALL = ("--max-image-size", "640", "--max-features", "1500")
FAST = (*SMALL, "--candidates", "12", "--global-descriptor", "vlad")


def reconstruct(folder: Path, output: Path, *more: str) -> int:
    return main(["reconstruct", str(folder), "--output", str(output), *FAST, *more])


def interrupt_after(monkeypatch: pytest.MonkeyPatch, photos: int, number: int) -> None:
    """Send a signal when this many photos have been added."""
    show = ProgressLine.show
    shown = []

    def show_and_interrupt(line: ProgressLine, event: Event) -> None:
        show(line, event)
        if isinstance(event, PhotoAdded):
            shown.append(event)
            if len(shown) == photos:
                signal.raise_signal(number)

    monkeypatch.setattr(ProgressLine, "show", show_and_interrupt)


def after_photo(monkeypatch: pytest.MonkeyPatch, name: str, act: Callable[[], object]) -> None:
    """Do something when this photo has been added; on one thread, the next is being read then."""
    show = ProgressLine.show

    def show_and_act(line: ProgressLine, event: Event) -> None:
        show(line, event)
        if isinstance(event, PhotoAdded) and event.name == name:
            act()

    monkeypatch.setattr(ProgressLine, "show", show_and_act)
