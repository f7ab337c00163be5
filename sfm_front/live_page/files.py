"""The files of an output to look at: ``report.html``, and ``scene.html`` where that can be made."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.live_page.extra import scene_if_possible
from sfm_front.reports.html.page import write_page


def write_files(output: Path, photos: Path | None = None) -> tuple[Path, Path | None]:
    """Write both anew; returns where. Without the extra or a model, there is no scene.

    ``photos``: their folder, if they are no longer where they were. Raises InputError if the output
    is not that of a session, or its page cannot be written.
    """
    scene = None
    with suppress(InputError):  # As while models are replaced: that of before stays.
        scene = scene_if_possible(output)
    return write_page(output, photos), scene  # The page has a link to the scene.


@contextmanager
def written_if_it_fails(output: Path) -> Iterator[None]:
    """Where a session ends by an error, its files say that it was stopped, and how it goes on."""
    try:
        yield
    except BaseException:
        # What went wrong may keep them from being written, too: it is what the user reads.
        with suppress(Exception):
            write_files(output)
        raise
