"""Learn VLAD's visual words from folders of photos and write them to a file."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import faiss

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from sfm_front.errors import SfmFrontError
from sfm_front.features.global_descriptors.codebook import SHIPPED_CODEBOOK
from sfm_front.features.global_descriptors.codebook_training import train_codebook
from sfm_front.features.sift import SiftExtractor, SiftOptions
from sfm_front.photos.reader import PhotoReader
from sfm_front.photos.source import list_photos
from sfm_front.types import Features, Skipped


def main() -> int:
    options = parse_arguments()
    try:
        photos = list(extract_features(options))
        codebook = train_codebook(
            photos,
            num_words=options.words,
            dimension=options.dimension,
            per_photo=options.per_photo,
            seed=options.seed,
        )
        codebook.save(options.output)
    except (SfmFrontError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    size_kb = options.output.stat().st_size / 1000
    print(
        f"{options.output}: {options.words} words of {options.dimension} from {len(photos)} "
        f"photos, {size_kb:.0f} kB, fingerprint {codebook.fingerprint}"
    )
    return 0


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="photos")
    parser.add_argument("--output", type=Path, default=SHIPPED_CODEBOOK, help=".npz to write")
    parser.add_argument("--words", type=int, default=256, help="number of visual words")
    parser.add_argument("--dimension", type=int, default=64, help="of projected descriptors")
    parser.add_argument(
        "--per-photo", type=int, default=400, help="descriptors drawn per photo to learn words"
    )
    parser.add_argument("--max-features", type=int, default=4000, help="SIFT features per photo")
    parser.add_argument("--max-image-size", type=int, default=1600, help="in pixels")
    parser.add_argument("--seed", type=int, default=0, help="of the draw and of k-means")
    return parser.parse_args()


def extract_features(options: argparse.Namespace) -> Iterator[Features]:
    """The features of each photo below the folders that has any.

    Raises InputError if a folder is missing or holds no photo.
    """
    # One thread, so that the same photos give the same file on every machine.
    cv2.setNumThreads(1)
    faiss.omp_set_num_threads(1)
    reader = PhotoReader(max_image_size=options.max_image_size)
    extractor = SiftExtractor(SiftOptions(max_features=options.max_features))
    for folder in options.folders:
        entries = list_photos(folder)
        for number, entry in enumerate(entries, start=1):
            photo = reader.read(entry.path, entry.name)
            if isinstance(photo, Skipped):
                print(f"skipped {entry.path}: {photo}", file=sys.stderr)
                continue
            yield extractor.extract(photo)
            print(f"\r{folder}: {number} of {len(entries)}", end="", file=sys.stderr, flush=True)
        print(file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
