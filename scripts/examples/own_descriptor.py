"""Retrieve photos by a custom global descriptor, joined with VLAD.

    python scripts/examples/own_descriptor.py FOLDER

Prints the most similar other photo for each photo. The descriptor is a colour histogram.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from sfm_front.features.extraction import FeatureExtraction, make_extractor
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.photos.reader import PhotoReader
from sfm_front.photos.source import list_photos
from sfm_front.retrieval.retriever import RetrievalOptions, Retriever
from sfm_front.types import ExtractedPhoto, Float32Array, Uint8Array


class ColourHistogram:
    """How often each of 4 x 4 x 4 colours occurs: a ``GlobalDescriptorPart`` over pixels."""

    name = "colour_histogram"
    dimension = 4**3
    fingerprint = "colour_histogram:4"  # change it whenever the vectors change

    def describe(self, pixels: Uint8Array, /) -> Float32Array:
        """(h, w, 3) uint8 RGB → (64,) float32 of length 1; square roots tame a large sky."""
        red, green, blue = (pixels // 64).reshape(-1, 3).T
        counts = np.bincount(red * 16 + green * 4 + blue, minlength=self.dimension)
        return np.asarray(np.sqrt(counts / counts.sum()), np.float32)


def main() -> None:
    """Describe every photo, remember it, then look up its neighbour."""
    parser = argparse.ArgumentParser(description="Retrieve photos by a custom descriptor.")
    parser.add_argument("folder", type=Path, help="photos, sub-folders included")
    photos = list_photos(parser.parse_args().folder)
    descriptor = GlobalDescriptor(networks=[ColourHistogram()], local=[Vlad()])
    retriever = Retriever(RetrievalOptions(candidates=2, num_expansion=0), descriptor.dimension)
    reader, sift = PhotoReader(max_image_size=800), make_extractor("cpu")
    with FeatureExtraction(reader, sift, descriptor, num_threads=2) as extraction:
        described = [p for p in extraction.stream(photos) if isinstance(p, ExtractedPhoto)]
    for image_id, photo in enumerate(described):
        retriever.remember(image_id, photo.global_vector)
    for image_id, photo in enumerate(described):
        others = [c for c in retriever.candidates(photo.global_vector) if c.image_id != image_id]
        for best in others[:1]:
            print(f"{photo.name}: {described[best.image_id].name} ({best.cosine:.3f})")


if __name__ == "__main__":
    main()
