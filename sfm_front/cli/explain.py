"""Tell why a photo was placed where it is, or was not: its candidates, matches and verdicts."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path

from sfm_front.cli.progress import LiveLine
from sfm_front.cli.terminal import printable
from sfm_front.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``explain``."""
    parser.add_argument("output", type=Path, help="output of a finished reconstruction")
    parser.add_argument("photo", help="the photo's name, as in report.json")
    parser.add_argument("--json", action="store_true", help="print all of it as one JSON object")
    parser.add_argument(
        "--draw",
        type=Path,
        metavar="FILE.png",
        help="picture of the matches with its first verified candidate, inliers in colour",
    )
    parser.add_argument(
        "--photos",
        type=Path,
        metavar="FOLDER",
        help="where the photos are, if they are no longer where they were",
    )
    parser.add_argument(
        "--against", metavar="PHOTO", help="draw the matches with this photo instead"
    )


def run(arguments: argparse.Namespace) -> int:
    """Explain; 0 if the photo is in a model, 1 if it is in none."""
    from sfm_front.reports.explanation import explain
    from sfm_front.viewers.pictures import check_picture

    if arguments.draw is not None:
        check_picture(arguments.draw)
    explanation = explain(arguments.output, arguments.photo)
    if arguments.json:
        from sfm_front.storage.json_files import as_json

        print(as_json(asdict(explanation)))
    else:
        print(printable(str(explanation)))
    if arguments.draw is not None:
        verified = [c.name for c in explanation.candidates if c.num_verified is not None]
        others = [*verified, *(c.name for c in explanation.candidates), *explanation.others]
        against = arguments.against or next(iter(others), None)
        if against is None:
            raise InputError(f"{arguments.photo}: nothing to draw, it has no candidates")
        _draw(arguments.output, arguments.photos, arguments.photo, against, arguments.draw)
        # Standard output may go to a program that expects JSON.
        LiveLine(sys.stderr, quiet=arguments.quiet).note(f"wrote {arguments.draw}")
    return 0 if explanation.model is not None else 1


def _draw(output: Path, photos: Path | None, name1: str, name2: str, file: Path) -> None:
    from sfm_front.reports.explanation import pair_matches, photo_files
    from sfm_front.viewers.match_drawing import draw_matches
    from sfm_front.viewers.pictures import save

    matches = pair_matches(output, name1, name2)
    files = photo_files(output) if photos is None else {n: photos / n for n in (name1, name2)}
    file1, file2 = files[name1], files[name2]
    for path in (file1, file2):
        if not path.is_file():
            raise InputError(f"{path}: no such photo. Give the folder where it is with --photos.")
    count = int(matches.is_inlier.sum())
    verdict = "verified" if matches.verified else "not verified, so matched again"
    caption = f"{name1}, {name2}: {count} of {len(matches.xy1)} matches are inliers ({verdict})"
    picture = draw_matches(
        file1,
        file2,
        matches.xy1,
        matches.xy2,
        matches.sizes,
        caption,
        matches.is_inlier,
    )
    save(picture, file)
