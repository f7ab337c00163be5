"""Show an output in a browser."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.exporters.scene import output_of
from sfm_front.live_page.address import FIRST_PORT
from sfm_front.live_page.beside_session import Note
from sfm_front.live_page.extra import check_installed
from sfm_front.reports import event_log
from sfm_front.storage.colmap_models import find_models


def serve(place: Path, note: Note, until: Callable[[], bool], port: int = FIRST_PORT) -> None:
    """``place``: the output of a session that runs or is finished, one of its models, or a COLMAP
    model of any program. ``note`` is told the address.

    Returns once ``until``. Raises InputError if there is no such folder or nothing in it to be
    shown, DependencyError if the page's library is not there.
    """
    check_installed()
    if not place.is_dir():
        raise InputError(f"{place}: no such folder; give the output of a session, or a model")
    output = output_of(place)
    if not (output / event_log.FILE).is_file() and not find_models(output):
        raise InputError(f"{place}: holds no session and no model")
    import pycolmap

    from sfm_front.live_page.server import LivePage

    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value
    with LivePage(output, port) as page:
        note(f"{page.address} shows {output}; Ctrl-C ends it")
        page.run(until)
