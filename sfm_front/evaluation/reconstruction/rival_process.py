"""The process that ``rivals`` starts: one pycolmap pipeline. Arguments: TASK.json RESULT.json."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pycolmap

_CAMERA_MODES = {
    "auto": pycolmap.CameraMode.AUTO,
    "single": pycolmap.CameraMode.SINGLE,
    "per-folder": pycolmap.CameraMode.PER_FOLDER,
    "per-image": pycolmap.CameraMode.PER_IMAGE,
}

#: Fewest descriptors per visual word (faiss asks for 39), and the largest number of words.
_DESCRIPTORS_PER_WORD = 40
_MAX_WORDS = 4096


class _NothingToMatchError(Exception):
    """This pairing cannot propose pairs of these photos."""


class _Pipeline:
    """Extract, match, map: one database, one clock."""

    def __init__(self, task: dict[str, Any]) -> None:
        self.task = task
        self.threads: int = task["threads"]
        self.workspace = Path(task["workspace"])
        self.database_path = self.workspace / "database.db"
        self.seconds: dict[str, float] = {}

    def run(self) -> str | None:
        """Why there is no model, or None."""
        with self._clock("extract"):
            self._extract()
        try:
            _PAIRINGS[self.task["pairing"]](self)
        except _NothingToMatchError as reason:
            return str(reason)
        with self._clock("map"):
            models = self._map()
        return None if models else "no initial pair, or no model that grew from one"

    def _extract(self) -> None:
        options = pycolmap.FeatureExtractionOptions()
        options.max_image_size = self.task["max_image_size_px"]
        options.sift.max_num_features = self.task["max_features"]
        options.num_threads = self.threads
        pycolmap.extract_features(
            self.database_path,
            self.task["photos"],
            camera_mode=_CAMERA_MODES[self.task["camera_mode"]],
            extraction_options=options,
            device=pycolmap.Device.cpu,
        )

    def exhaustive(self) -> None:
        self._match(pycolmap.match_exhaustive, pycolmap.ExhaustivePairingOptions())

    def sequential(self) -> None:
        self._match(pycolmap.match_sequential, pycolmap.SequentialPairingOptions())

    def spatial(self) -> None:
        with pycolmap.Database.open(self.database_path) as database:
            priors = database.read_all_pose_priors()
        # EXIF with a gravity direction also gives a prior, without a position.
        if sum(bool(np.isfinite(prior.position).all()) for prior in priors) < 2:
            raise _NothingToMatchError("these photos have no GPS position")
        options = pycolmap.SpatialPairingOptions()
        options.num_threads = self.threads
        self._match(pycolmap.match_spatial, options)

    def vocabtree(self) -> None:
        options = pycolmap.VocabTreePairingOptions()
        options.num_threads = self.threads
        options.vocab_tree_path = self.workspace / "words.bin"
        with self._clock("train"):
            self._learn_words(options.vocab_tree_path)
        self._match(pycolmap.match_vocabtree, options)

    def _learn_words(self, path: Path) -> None:
        with pycolmap.Database.open(self.database_path) as database:
            descriptors = np.concatenate(
                [
                    database.read_descriptors(image.image_id).data
                    for image in database.read_all_images()
                ]
            ).astype(np.float32)
        words = min(_MAX_WORDS, len(descriptors) // _DESCRIPTORS_PER_WORD)
        if words < 1:
            raise _NothingToMatchError("these photos have too few features to learn words from")
        options = pycolmap.VisualIndex.BuildOptions()
        options.num_visual_words = words
        options.num_iterations = 10
        options.num_rounds = 1
        options.num_threads = self.threads
        index = pycolmap.VisualIndex.create(descriptors.shape[1], 64)
        index.build(
            options,
            pycolmap.FeatureDescriptorsFloat(pycolmap.FeatureExtractorType.SIFT, descriptors),
        )
        index.write(path)

    def _match(self, match: Callable[..., None], pairing: Any) -> None:
        options = pycolmap.FeatureMatchingOptions()
        options.num_threads = self.threads
        with self._clock("match"):
            match(
                self.database_path,
                matching_options=options,
                pairing_options=pairing,
                device=pycolmap.Device.cpu,
            )

    def _map(self) -> int:
        options = pycolmap.IncrementalPipelineOptions()
        options.num_threads = self.threads
        sparse = self.workspace / "sparse"
        sparse.mkdir()
        return len(
            pycolmap.incremental_mapping(
                self.database_path, self.task["photos"], sparse, options=options
            )
        )

    @contextmanager
    def _clock(self, stage: str) -> Iterator[None]:
        started = perf_counter()
        yield
        self.seconds[stage] = perf_counter() - started


_PAIRINGS: dict[str, Callable[[_Pipeline], None]] = {
    "exhaustive": _Pipeline.exhaustive,
    "sequential": _Pipeline.sequential,
    "spatial": _Pipeline.spatial,
    "vocabtree": _Pipeline.vocabtree,
}


def main(task: Path, result: Path) -> None:
    """Run the pipeline in the file ``task``; write stage seconds and failure to ``result``."""
    pycolmap.logging.minloglevel = pycolmap.logging.ERROR.value
    pipeline = _Pipeline(json.loads(task.read_text()))
    failure = pipeline.run()
    result.write_text(json.dumps({"seconds_by_stage": pipeline.seconds, "failure": failure}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
