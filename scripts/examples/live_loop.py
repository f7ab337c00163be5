"""Reconstruct photos as they arrive in a folder.

    python scripts/examples/live_loop.py FOLDER OUTPUT [--idle SECONDS]

Copy photos into FOLDER while it runs. It ends after --idle seconds without a new photo.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from sfm_front import Session, SessionOptions, SfmFrontError, Skipped
from sfm_front.photos.formats import EXTENSIONS


def arriving_photos(folder: Path, idle_s: float, poll_s: float = 0.2) -> Iterator[Path]:
    """Each photo in ``folder`` once, as soon as its file has stopped growing."""
    taken: set[Path] = set()
    sizes: dict[Path, int] = {}
    waited_s = 0.0  # without the caller's own time
    while waited_s < idle_s:
        photos = [path for path in folder.iterdir() if path.name.lower().endswith(EXTENSIONS)]
        before, sizes = sizes, {path: path.stat().st_size for path in photos}
        for path in sorted(sizes.keys() - taken):
            if sizes[path] == before.get(path):
                taken.add(path)
                yield path
        waited_s = waited_s + poll_s if sizes == before else 0.0
        time.sleep(poll_s)


def main() -> None:
    """Add photos to a session as they arrive."""
    parser = argparse.ArgumentParser(description="Reconstruct photos as they arrive.")
    parser.add_argument("folder", type=Path, help="where photos arrive")
    parser.add_argument("output", type=Path, help="a folder to write to")
    parser.add_argument("--idle", type=float, default=30.0, metavar="SECONDS")
    arguments = parser.parse_args()
    if not arguments.folder.is_dir():
        parser.error(f"{arguments.folder}: no such folder")
    with Session(arguments.output, SessionOptions(global_descriptor="vlad")) as session:
        for path in arriving_photos(arguments.folder, arguments.idle):
            photo = session.add(path)
            if isinstance(photo, Skipped):
                print(f"{photo.name}: skipped, {photo}", flush=True)
            else:
                placed = ", ".join(photo.registered) or "nothing yet"
                print(f"{photo.name}: placed {placed}", flush=True)
        result = session.finish()
    totals = result.summary.totals
    print(
        f"registered {totals.num_registered} of {totals.num_photos}, models: {len(result.models)}"
    )


if __name__ == "__main__":
    try:
        main()
    except SfmFrontError as error:
        sys.exit(str(error))
