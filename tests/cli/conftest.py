"""A few real photos, and signals as a shell leaves them."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers.locations import VILLAGE
from helpers.signal_handlers import default_handlers


@pytest.fixture
def five(tmp_path) -> Path:
    folder = tmp_path / "photos"
    folder.mkdir()
    for photo in sorted((VILLAGE / "images").iterdir())[:5]:
        shutil.copy(photo, folder / photo.name)
    return folder


@pytest.fixture
def handlers() -> Iterator[None]:
    with default_handlers():
        yield
