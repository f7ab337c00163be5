"""The cost of a photo by its place in a long stream: a session on a synthetic flight."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.evaluation.poses import auc, pose_errors
from sfm_front.evaluation.process import resident_bytes
from sfm_front.evaluation.reconstruction.colmap_memory import colmap_memory_bytes
from sfm_front.evaluation.synthetic.positions import camera_centers, measured_positions
from sfm_front.evaluation.synthetic.scene import SyntheticScene, as_described, make_scene
from sfm_front.events import PhotoAdded
from sfm_front.features.global_descriptors.descriptor import resolve
from sfm_front.georeference.accuracy import bend_of_heights
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session
from sfm_front.types import Float64Array

_DESCRIPTOR = "vlad"


@dataclass(frozen=True, slots=True)
class PhotoCost:
    """The cost of one photo from retrieval to mapping: wall seconds without and with global
    refinement, and CPU seconds with refinement, which other work on the machine hardly affects.
    ``memory_bytes``: the process's memory afterwards; None on systems without /proc.
    ``retrieval_seconds``: of the wall seconds, those of the query of the index.
    """

    seconds: float
    seconds_with_refinement: float
    processor_seconds: float
    memory_bytes: int | None
    num_registered: int
    retrieval_seconds: float = 0.0

    @property
    def refinement_processor_seconds(self) -> float:
        """CPU seconds of global refinement: its share of the wall seconds."""
        refinement = self.seconds_with_refinement - self.seconds
        return self.processor_seconds * refinement / self.seconds_with_refinement


@dataclass(frozen=True, slots=True)
class Growth:
    """Cost of late photos over cost of early ones, by the figures of ``PhotoCost`` and, as
    ``amortized_seconds``, with each refinement spread over the photos since the previous one."""

    seconds: float
    seconds_with_refinement: float
    amortized_seconds: float
    processor_seconds: float


@dataclass(frozen=True, slots=True)
class Memory:
    """Bytes that the process held before the first photo, with the synthetic flight in it, and at
    most; and, of that, pycolmap's correspondence graph and models. None where it cannot be told."""

    at_start: int | None
    peak: int | None
    colmap: int | None


@dataclass(frozen=True, slots=True)
class StreamResult:
    """``finish_seconds``: the end of the session, export included. ``auc``: of the pose errors of
    all pairs, at 1, 3 and 5 degrees, in [0, 1]. ``bend_share``: how far the largest model is bent
    up or down at the end, as a share of the extent; None for a small one.
    ``finish_processor_seconds`` and ``beside_processor_seconds``: CPU seconds of the end, and of
    the process that refines models beside a session of several threads."""

    photos: tuple[PhotoCost, ...]
    finish_seconds: float
    memory: Memory
    num_registered: int
    auc: tuple[float, ...]
    bend_share: float | None = None
    finish_processor_seconds: float = 0.0
    beside_processor_seconds: float = 0.0

    def growth(self, early: slice, late: slice) -> Growth:
        """Mean over the late photos divided by mean over the early ones, for each figure."""
        figures = {
            name: np.array([getattr(photo, name) for photo in self.photos])
            for name in ("seconds", "seconds_with_refinement", "processor_seconds")
        }
        figures["amortized_seconds"] = self.amortized_seconds()
        return Growth(
            **{
                name: float(values[late].mean() / values[early].mean())
                for name, values in figures.items()
            }
        )

    def amortized_seconds(self) -> Float64Array:
        """(N,) wall seconds, each refinement spread over the photos since the previous one.

        Refinements are rare, and rarer as the model grows: which hundred photos one falls into is
        chance. Photos after the last one get its share too.
        """
        return _amortized(
            np.array([photo.seconds_with_refinement for photo in self.photos]),
            np.array([photo.seconds_with_refinement - photo.seconds for photo in self.photos]),
        )

    def amortized_processor_seconds(self) -> Float64Array:
        """(N,) the same in CPU seconds."""
        return _amortized(
            np.array([photo.processor_seconds for photo in self.photos]),
            np.array([photo.refinement_processor_seconds for photo in self.photos]),
        )

    def exponent(self, start: int) -> float:
        """The exponent of a photo's CPU seconds as a power of its number, from ``start`` on.

        0 is constant, 1 linear. Because refinements come in lumps, the cumulative sum is fitted,
        whose exponent is one more.
        """
        total = np.cumsum([photo.processor_seconds for photo in self.photos])
        numbers = np.arange(1, len(total) + 1)
        slope, _ = np.polyfit(np.log(numbers[start:]), np.log(total[start:]), 1)
        return float(slope) - 1

    @property
    def peak_in_stream(self) -> int | None:
        """The most bytes held after a photo; the end of the session may need more."""
        return max((photo.memory_bytes or 0 for photo in self.photos), default=0) or None

    def memory_per_photo(self, start: int) -> float | None:
        """Bytes per photo from ``start`` on: the slope of a fitted line."""
        memory = [photo.memory_bytes for photo in self.photos[start:]]
        known = np.array([value for value in memory if value is not None], np.float64)
        if len(known) < len(memory) or len(known) < 2:
            return None
        slope, _ = np.polyfit(np.arange(len(known)), known, 1)
        return float(slope)


def _amortized(seconds: Float64Array, refinement: Float64Array) -> Float64Array:
    """(N,) seconds, of which those of ``refinement`` are spread."""
    spread = np.zeros(len(seconds))
    start = 0
    for end in (np.flatnonzero(refinement > 0) + 1).tolist():
        spread[start:] = refinement[end - 1] / (end - start)
        start = end
    amortized: Float64Array = seconds - refinement + spread
    return amortized


def run_stream(
    num_photos: int,
    points_per_image: int,
    output: Path,
    options: SessionOptions,
    *,
    seed: int,
    note: Callable[[PhotoAdded], None],
    gps_noise_m: float | None = None,
    lens: tuple[float, float, float] | None = None,
) -> StreamResult:
    """Fly strips over hills and reconstruct from given features; nothing is read or detected.

    ``note`` is called with each photo's report. ``gps_noise_m``: standard deviation along each axis
    of the positions that photos have, and say that they have; without, they have none. ``lens``: as
    ``make_scene`` takes it. Raises ConfigError for fewer than two photos, or a negative noise.
    """
    if num_photos < 2:
        raise ConfigError(f"a stream needs at least two photos, got {num_photos}")
    scene = make_scene(num_photos, points_per_image, seed=seed, layout="strip", lens=lens)
    positions = measured_positions(scene, gps_noise_m)
    descriptor, _ = resolve(_DESCRIPTOR)
    costs: list[PhotoCost] = []
    at_start, beside = resident_bytes(), _of_ended_processes()
    with Session(output, options) as session:
        for index in range(num_photos):
            seen = scene.photo(index)
            vector = descriptor.describe(np.empty(0, np.uint8), seen.features)
            photo = as_described(seen, scene.camera, vector, positions[index])
            started, processor_started = perf_counter(), process_time()
            added = session.add_extracted(photo)
            assert isinstance(added, PhotoAdded)  # no two photos of the scene are copies
            seconds = perf_counter() - started
            costs.append(
                PhotoCost(
                    seconds - added.seconds.get("refine", 0.0),
                    seconds,
                    process_time() - processor_started,
                    resident_bytes(),
                    added.num_registered,
                    added.seconds["retrieve"],
                )
            )
            note(added)
        started, processor_started = perf_counter(), process_time()
        ended = session.finish()
        finish_seconds = perf_counter() - started
        finish_processor_seconds = process_time() - processor_started
    # It ends with the session.
    beside = _of_ended_processes() - beside
    models = [model.reconstruction for model in ended.models]
    peak = ended.summary.totals.peak_memory_bytes
    return StreamResult(
        photos=tuple(costs),
        finish_seconds=finish_seconds,
        memory=Memory(at_start, peak, colmap_memory_bytes(output)),
        num_registered=max((int(model.num_reg_images()) for model in models), default=0),
        auc=tuple(auc(pose_errors(scene.truth(), models))),
        bend_share=_bend_share(scene, models),
        finish_processor_seconds=finish_processor_seconds,
        beside_processor_seconds=beside,
    )


def _of_ended_processes() -> float:
    """CPU seconds of processes that this one has started and that have ended."""
    times = os.times()
    return times.children_user + times.children_system


def _bend_share(scene: SyntheticScene, models: Sequence[pycolmap.Reconstruction]) -> float | None:
    """Of the largest model, laid upon the truth by the best similarity."""
    if not models:
        return None
    model = max(models, key=lambda model: model.num_reg_images())
    index = {scene.name(i): i for i in range(len(scene))}
    images = [model.image(image_id) for image_id in model.reg_image_ids()]
    found = np.array([image.projection_center() for image in images])
    true = camera_centers(scene)[[index[image.name] for image in images]]
    enu_from_model = pycolmap.estimate_sim3d(found, true)
    if enu_from_model is None:
        return None
    bend = bend_of_heights(true, (enu_from_model * found - true)[:, 2])
    return None if bend is None else bend.share_of_extent
