"""Reconstruct a folder of photos, one image at a time.

Each photo is retrieved against those before it, its verified matches go into a COLMAP database,
and it is placed in a model before the next one is taken.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING

from sfm_front.cli.command_again import command_again
from sfm_front.cli.progress import ProgressLine
from sfm_front.cli.reconstruct_arguments import add_arguments as add_arguments
from sfm_front.cli.reconstruct_arguments import session_options
from sfm_front.cli.result import tell_nothing_to_do, tell_result
from sfm_front.cli.signals import CLOSING, leaving_at_signal
from sfm_front.errors import InputError
from sfm_front.events import Listener
from sfm_front.photos.source import list_photos, order_photos
from sfm_front.reports.words import counted

if TYPE_CHECKING:
    from sfm_front.live_page.beside_session import PageBesideSession
    from sfm_front.session.options import SessionOptions
    from sfm_front.types import NotYet, PhotoPath

_STOPPING = "stopping: finishing with the photos taken so far; once more leaves at once"


def run(arguments: argparse.Namespace) -> int:
    """Reconstruct, or print the options; 1 if no model could be built, else 0."""
    with ExitStack() as opened:
        return _run(arguments, opened)


def _run(arguments: argparse.Namespace, opened: ExitStack) -> int:
    if arguments.print_config:
        from sfm_front.cli.config_file import as_toml

        print(as_toml(session_options(arguments)), end="")
        return 0
    if arguments.folder is None:
        arguments.usage_error("the following arguments are required: folder")
    if arguments.idle_timeout is not None and not arguments.watch:
        arguments.usage_error("--idle-timeout goes with --watch")
    if arguments.order != "name" and arguments.watch:
        arguments.usage_error("--watch takes photos as they come: leave --order out")
    if arguments.cluster is not None and arguments.watch:
        arguments.usage_error("--watch takes photos as they come: leave --cluster out")
    if arguments.group_size is not None and arguments.cluster is None:
        arguments.usage_error("--group-size goes with --cluster")
    if arguments.events and arguments.json:
        arguments.usage_error("--events and --json both take standard output: leave one out")
    spoken = sys.stderr if arguments.events or arguments.json else sys.stdout
    progress = ProgressLine(spoken, quiet=arguments.quiet)
    cluster = None
    if arguments.cluster is not None:
        from sfm_front.cli.cluster_run import ClusterRun

        cluster = opened.enter_context(ClusterRun(arguments, progress))
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.Level.ERROR.value
    folder: Path = arguments.folder
    output: Path = arguments.output or default_output(folder)
    overwrite, append = arguments.overwrite, arguments.append
    # Once more: pycolmap has put a handler of its own for SIGTERM in place.
    with leaving_at_signal(1):
        from sfm_front.live_page.files import write_files, written_if_it_fails
        from sfm_front.live_page.files_beside_session import FilesBesideSession
        from sfm_front.photos.watch import WatchOptions, check_watchable, watch_photos
        from sfm_front.session.given import GivenSession
        from sfm_front.session.output_folder import holds_session, told_of_others
        from sfm_front.session.resume import Newcomers, nothing_to_do
        from sfm_front.session.session import Session

        options = session_options(arguments)
        watch = WatchOptions(idle_timeout_s=arguments.idle_timeout)
        photos: list[PhotoPath] = []
        if arguments.watch:
            check_watchable(folder)
        else:
            photos = _photos(arguments, output, options)
        if not (arguments.watch or overwrite) and nothing_to_do(
            output, options, folder, photos, append=append
        ):
            tell_nothing_to_do(arguments, output)
            return 0
        if not arguments.watch and (overwrite or not holds_session(output)):
            _check_control_points(options, photos)
        if others := told_of_others(output):
            progress.note(others)
        on_event = _event_printer() if arguments.events else progress.show
        # Also with --quiet: nobody finds the page without its address.
        page = _page(output, progress.keep, opened) if arguments.viewer else None
        if cluster is not None:
            cluster.ready()
        session = (Session if cluster is None else GivenSession)(
            output,
            options,
            overwrite=overwrite,
            resume=not overwrite,
            on_event=on_event,
            command=command_again(arguments.given),
        )
    opened.enter_context(written_if_it_fails(output))
    with session, closing(progress), leaving_at_signal(2, _STOPPING) as interrupted:
        for message in session.messages:
            progress.note(message)
        if session.num_restored:
            progress.note(f"continuing {output}: {session.num_restored} photos are in it")
        new: list[PhotoPath] = []
        newcomers = Newcomers(session.database, folder, output, append=append)
        arriving: Iterable[PhotoPath | NotYet]
        if arguments.watch:
            appearing = watch_photos(
                folder,
                watch,
                exclude=output,
                stop=interrupted,
                idle_s=lambda: session.idle_s,
                note=progress.note,
            )
            arriving = newcomers.among(appearing, progress.note)
        else:
            new = list(newcomers.among(photos, progress.note))
            progress.expect(len(new))
            arriving = new
        taken = 0
        with FilesBesideSession(output):
            if cluster is not None:
                assert isinstance(session, GivenSession)
                result, taken = cluster.reconstruct(session, new, interrupted)
            else:
                for _ in session.add_all(arriving):
                    taken += 1
                    if interrupted():
                        break
                result = session.finish(0 if arguments.watch else len(new) - taken)
        progress.step("drawing the page")
        write_files(output)
        progress.close()
        tell_result(arguments, result.summary, output, spoken)
        if not arguments.watch and taken < len(new):
            left = counted(len(new) - taken, "photo")
            without = " without --overwrite" if overwrite else ""
            told = f"stopped with {left} to go: the same command{without} goes on from there"
            print(told, file=spoken)
    if page is not None:
        with leaving_at_signal(2, CLOSING) as interrupted:
            page.stay(interrupted)
    return 0 if result.models else 1


def _page(output: Path, note: Callable[[str], None], opened: ExitStack) -> PageBesideSession:
    from sfm_front.live_page.beside_session import PageBesideSession

    return opened.enter_context(PageBesideSession(output, note))


def _event_printer() -> Listener:
    from sfm_front.reports.event_log import EventLog

    return EventLog(sys.stdout).write


def _photos(
    arguments: argparse.Namespace, output: Path, options: SessionOptions
) -> list[PhotoPath]:
    from sfm_front.exporters.colmap import first_name_lost_in_text

    listed = list_photos(arguments.folder, exclude=output)
    if options.text and (lost := first_name_lost_in_text(photo.name for photo in listed)):
        raise InputError(
            f"{lost!r}: COLMAP's text format would cut this name at its white space. "
            "Rename the photo, or leave --text out."
        )
    return order_photos(listed, arguments.order, seed=options.seed)


def _check_control_points(options: SessionOptions, photos: Sequence[PhotoPath]) -> None:
    """All photos are known: told before hours of work if too few of them have marks."""
    from sfm_front.georeference.control.marks import check_photos
    from sfm_front.georeference.control.point_file import read_control_points

    file = options.control_points.file
    if file is not None:
        check_photos(file, read_control_points(file), (photo.name for photo in photos))


def default_output(folder: Path) -> Path:
    """``outputs/NAME`` below the working folder."""
    try:
        resolved = folder.resolve()
    except (OSError, RuntimeError):  # Links in a circle, no working folder: listing will say so.
        resolved = folder
    named = resolved.parent if resolved.name.lower() == "images" else resolved
    return Path("outputs") / (named.name or "photos")
