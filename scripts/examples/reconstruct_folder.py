"""Reconstruct a folder of photos from Python.

    python scripts/examples/reconstruct_folder.py FOLDER OUTPUT [--max-image-size PX]

OUTPUT receives the models in COLMAP's format, below ``sparse/``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from sfm_front import Session, SessionOptions, SfmFrontError, Skipped
from sfm_front.photos.source import list_photos


def reconstruct(folder: Path, output: Path, options: SessionOptions) -> None:
    """Reconstruct the photos in ``folder`` and print what was registered."""
    photos = list_photos(folder, exclude=output)
    with Session(output, options) as session:
        for photo in session.add_all(photos):
            if isinstance(photo, Skipped):
                print(f"{photo.name}: skipped, {photo}")
            else:
                print(f"{photo.name}: {photo.num_registered} registered so far")
        result = session.finish()

    for model in result.models:
        images = model.reconstruction.images
        names = sorted(images[i].name for i in model.reconstruction.reg_image_ids())
        print(f"{model.path}: {model.num_registered} photos, {model.num_points} points")
        print(f"  {', '.join(names)}")
    registered = result.summary.totals.num_registered
    print(f"registered {registered} of {len(photos)} photos, models: {len(result.models)}")


def main() -> None:
    """Read the command line and reconstruct."""
    parser = argparse.ArgumentParser(description="Reconstruct a folder of photos.")
    parser.add_argument("folder", type=Path, help="photos, sub-folders included")
    parser.add_argument("output", type=Path, help="a folder to write to")
    parser.add_argument("--max-image-size", type=int, default=1600, metavar="PX")
    arguments = parser.parse_args()
    # VLAD needs no network weights; the default, "auto", may download some.
    options = SessionOptions(global_descriptor="vlad", max_image_size=arguments.max_image_size)
    reconstruct(arguments.folder, arguments.output, options)


if __name__ == "__main__":
    try:
        main()
    except SfmFrontError as error:
        sys.exit(str(error))
