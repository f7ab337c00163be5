"""Find the photos of a folder that show the same scene as a given photo.

Global vectors propose photos, and verified SIFT matches put them in order. The folder is indexed
once; later runs describe only what is new or has changed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sfm_front.cli import arguments as shared
from sfm_front.cli.progress import CountLine, LiveLine
from sfm_front.cli.reconstruct import default_output
from sfm_front.cli.terminal import printable
from sfm_front.errors import ConfigError, InputError
from sfm_front.photos.source import list_photos
from sfm_front.types import ExtractedPhoto, PhotoPath, Skipped

if TYPE_CHECKING:
    from sfm_front.features.cached_extraction import CachedExtraction
    from sfm_front.search.folder_search import Answer, FolderSearch, SearchOptions
    from sfm_front.search.photo_index import PhotoIndex
    from sfm_front.session.options import SessionOptions

_MOST_SKIPPED_TOLD = 20
_STANDARD_OUTPUT = Path("-")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``retrieve``. Defaults left out here are the session's."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folder", type=Path, help="photos to search, sub-folders included")
    parser.add_argument(
        "--query",
        type=Path,
        nargs="+",
        action="extend",
        required=True,
        metavar="PHOTO",
        help="photos to search with: any file, or a name below the folder",
    )
    parser.add_argument(
        "--index",
        type=Path,
        metavar="DIR",
        help="where the folder's index is kept (default: outputs/NAME/index, by the folder's name)",
    )
    output = parser.add_argument_group("output")
    output.add_argument(
        "--top", type=int, default=10, metavar="N", help="rows of the table (default: %(default)s)"
    )
    output.add_argument(
        "--json",
        type=Path,
        nargs="?",
        const=_STANDARD_OUTPUT,
        metavar="FILE",
        help="write the whole ranking as JSON, to FILE, or in place of the table",
    )
    output.add_argument(
        "--sheet", type=Path, metavar="FILE.png", help="picture of each query and its ten best"
    )
    output.add_argument(
        "--draw-matches",
        type=Path,
        metavar="FILE.png",
        help="picture of the verified matches between the first query and its best photo",
    )
    output.add_argument(
        "--ground-truth",
        "--truth",
        type=Path,
        metavar="FILE",
        help="relevant names, one a line, or lines 'name name n'; other photos are marked wrong",
    )
    method = parser.add_argument_group("method")
    method.add_argument(
        "--method",
        default="ours",
        help="ours (default), exhaustive (match all photos in full) or cosine (no matching)",
    )
    shared.add_retrieval(method)
    shared.add_photos(method)
    shared.add_machine(parser)


def run(arguments: argparse.Namespace) -> int:
    """Search; 0 if every query was answered, 1 if the folder has no other photo to find."""
    from sfm_front.runtime.devices import usable_device
    from sfm_front.runtime.worker_pool import WorkerPool
    from sfm_front.search.folder_search import FolderSearch
    from sfm_front.search.photo_index import PhotoIndex

    folder: Path = arguments.folder
    location: Path = arguments.index or default_output(folder) / "index"
    photos = list_photos(folder, exclude=location)
    queries = [_find_query(query, folder, photos) for query in arguments.query]
    _check_outputs(arguments)
    options, search_options = _options(arguments)
    device, on_device = usable_device(options.device)
    # Apart from the answer, which may go through a pipe.
    line = CountLine("indexing photo", sys.stderr, quiet=arguments.quiet)
    if on_device:
        line.note(on_device)
    describer = _describer(options, location, device, line)
    index = PhotoIndex(location, describer)
    _update(index, photos, options.threads, line)
    described = [_describe(describer, query) for query in queries]
    with WorkerPool(options.threads) as workers:
        search = FolderSearch(index, search_options, workers, device=device)
        answers = [search.ask(query) for query in described]
        _show(arguments, answers, photos, line)
        if arguments.draw_matches is not None and answers[0].found:
            _draw_matches(arguments.draw_matches, index, search, described[0], answers[0])
            line.note(f"wrote {arguments.draw_matches}")
    return 0 if all(answer.found for answer in answers) else 1


def _find_query(query: Path, folder: Path, photos: Sequence[PhotoPath]) -> PhotoPath:
    """The query's file; one that lies in the folder has the name that it has there."""
    path = query if query.exists() else folder / query
    if not path.exists():
        raise InputError(f"{query}: no such photo. Give a file, or a name below {folder}.")
    resolved = path.resolve()
    inside = (photo for photo in photos if photo.path.resolve() == resolved)
    return next(inside, PhotoPath(path.name, path))


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Before any work: what can be told to fail later fails now."""
    from sfm_front.viewers.pictures import check_picture

    if arguments.top < 1:
        raise ConfigError(f"--top must be at least 1, got {arguments.top}")
    for picture in (arguments.sheet, arguments.draw_matches):
        if picture is not None:
            check_picture(picture)


def _options(arguments: argparse.Namespace) -> tuple[SessionOptions, SearchOptions]:
    """What was given on the command line; the rest is as in a reconstruction."""
    from sfm_front.search.folder_search import SearchOptions
    from sfm_front.session.options import SessionOptions

    session = SessionOptions(**shared.given(arguments))
    search = SearchOptions(
        method=arguments.method,
        retrieval=session.retrieval,
        rerank=session.rerank,
        matching=session.matching,
        verification=session.verification,
    )
    return session, search


def _describer(
    options: SessionOptions, location: Path, device: str, line: LiveLine
) -> CachedExtraction:
    from sfm_front.features.cached_extraction import CachedExtraction
    from sfm_front.features.extraction import make_extractor
    from sfm_front.features.global_descriptors.descriptor import resolve
    from sfm_front.photos.reader import PhotoReader

    descriptor, message = resolve(
        options.global_descriptor,
        weights=options.weights,
        vlad_weight=options.vlad_weight,
        device=device,
    )
    if message:
        line.note(message)
    return CachedExtraction(
        location,
        PhotoReader(max_image_size=options.max_image_size),
        make_extractor(device, options.sift),
        {descriptor.name: descriptor},
    )


def _update(index: PhotoIndex, photos: Sequence[PhotoPath], threads: int, line: CountLine) -> None:
    """Bring the index up to date and tell what that took."""
    update = index.update(photos, num_threads=threads, progress=line.show)
    line.end()
    line.note(str(update))
    for skipped in update.skipped[:_MOST_SKIPPED_TOLD]:
        line.note(f"skipped {skipped.name}: {skipped}")
    if len(update.skipped) > _MOST_SKIPPED_TOLD:
        line.note(f"skipped {len(update.skipped) - _MOST_SKIPPED_TOLD} more")


def _describe(describer: CachedExtraction, query: PhotoPath) -> ExtractedPhoto:
    described = describer.describe(query)
    if isinstance(described, Skipped):
        raise InputError(f"{query.path}: {described}. Give another --query.")
    return described.photo


def _show(
    arguments: argparse.Namespace,
    answers: Sequence[Answer],
    photos: Sequence[PhotoPath],
    line: LiveLine,
) -> None:
    from sfm_front.cli import retrieve_output
    from sfm_front.search.ground_truth import read_ground_truth
    from sfm_front.viewers import pictures

    relevant: list[frozenset[str] | None] = [None] * len(answers)
    if arguments.ground_truth is not None:
        truth = read_ground_truth(arguments.ground_truth, [photo.name for photo in photos])
        relevant = [truth.of(answer.query.name) for answer in answers]
    if arguments.json is not None:
        _write_rows(retrieve_output.rows(answers), arguments.json, line)
    if arguments.json != _STANDARD_OUTPUT:
        for answer, names in zip(answers, relevant, strict=True):
            print(printable(retrieve_output.table(answer, names, arguments.top)))
    if arguments.sheet is not None:
        pictures.save(retrieve_output.sheet(answers, relevant), arguments.sheet)
        line.note(f"wrote {arguments.sheet}")


def _write_rows(rows: Sequence[object], file: Path, line: LiveLine) -> None:
    from sfm_front.storage.json_files import as_json, write_json

    if file == _STANDARD_OUTPUT:
        print(as_json(rows))
        return
    write_json(file, rows)
    line.note(f"wrote {file}")


def _draw_matches(
    file: Path, index: PhotoIndex, search: FolderSearch, query: ExtractedPhoto, answer: Answer
) -> None:
    from sfm_front.cli import retrieve_output
    from sfm_front.viewers import pictures

    best = index.described(answer.found[0].image_id).photo
    matches = search.verified_matches(query, best)
    pictures.save(retrieve_output.matches_picture(query, best, matches), file)
