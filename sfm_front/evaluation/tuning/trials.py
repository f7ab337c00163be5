"""Sessions over the described photos of a scene, and what they built."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.reconstruction.quality import Quality, assess
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene, find_scene, limited_to
from sfm_front.evaluation.tuning.arrangements import arrange
from sfm_front.evaluation.tuning.option_paths import nearest
from sfm_front.events import PhotoAdded
from sfm_front.features.cached_extraction import CachedExtraction
from sfm_front.features.extraction import make_extractor
from sfm_front.features.global_descriptors.descriptor import resolve
from sfm_front.photos.reader import PhotoReader
from sfm_front.photos.source import list_photos
from sfm_front.runtime.devices import usable_device
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session
from sfm_front.types import ExtractedPhoto, Skipped

Described = ExtractedPhoto | Skipped


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One session.

    ``seconds``: of the processor, without describing photos; other work on the machine hardly
    changes them.
    """

    scene: str
    arrangement: str
    photos: int
    quality: Quality
    verified_pairs: int
    seconds: float


@dataclass(frozen=True, slots=True)
class TrialKey:
    """What a trial's result depends on."""

    scene: str
    arrangement: str
    options: SessionOptions


Trials = dict[TrialKey, Trial]


def find_scenes(data: Path, names: Sequence[str] | None) -> list[BenchmarkScene]:
    """The scenes in the folders of ``data`` with these names; by default all that have photos.

    Raises InputError if there is none, and ConfigError for an unknown name.
    """
    if not data.is_dir():
        raise InputError(f"{data}: no such folder; give one that holds a folder per scene")
    scenes = {}
    for folder in sorted(path for path in data.iterdir() if path.is_dir()):
        try:
            scenes[folder.name] = find_scene(folder)
        except InputError:
            if names is not None and folder.name in names:
                raise
    if not scenes:
        raise InputError(f"{data}: no folder in it holds photos; give one with a folder per scene")
    for name in names or ():
        if name not in scenes:
            raise ConfigError(
                f"{data}: no scene {name!r} in it; did you mean {nearest(name, scenes)}?"
            )
    return [scenes[name] for name in (names or scenes)]


def num_photos(scene: BenchmarkScene, arrangements: Sequence[str], num_options: int = 1) -> int:
    """How many photos are described or taken in."""
    arriving = sum(len(arrange(range(scene.num_photos), name)) for name in arrangements)
    return scene.num_photos + num_options * arriving


def counter(show: Callable[[int, int], None], total: int) -> Callable[[], None]:
    """To be called for each photo: shows how many are done, of ``total``."""
    done = itertools.count(1)
    return lambda: show(next(done), total)


def describe(
    scene: BenchmarkScene, cache: Path, options: SessionOptions, count: Callable[[], None]
) -> list[Described]:
    """The photos of a scene in order of name, as a session would describe them.

    ``cache``: a folder that keeps features. ``count`` is called for each photo.
    """
    device, _ = usable_device(options.device)
    descriptor, _ = resolve(options.global_descriptor, weights=options.weights, device=device)
    extraction = CachedExtraction(
        cache,
        PhotoReader(max_image_size=options.max_image_size),
        make_extractor(device, options.sift),
        {descriptor.name: descriptor},
    )
    described: list[Described] = []
    stream = extraction.stream(list_photos(scene.photos), num_threads=options.threads)
    for found in stream:
        described.append(found if isinstance(found, Skipped) else found.photo)
        count()
    return described


def try_scene(
    scene: BenchmarkScene,
    described: Sequence[Described],
    arrangements: Sequence[str],
    options: Iterable[SessionOptions],
    count: Callable[[], None],
) -> Trials:
    """Every arrangement with all options. ``described``: in order of name."""
    return {
        TrialKey(scene.name, arrangement, tried): run_trial(
            scene, described, arrangement, tried, count
        )
        for arrangement in arrangements
        for tried in options
    }


def run_trial(
    scene: BenchmarkScene,
    described: Sequence[Described],
    arrangement: str,
    options: SessionOptions,
    count: Callable[[], None],
) -> Trial:
    """One session over the photos as arranged, and what its models are worth.

    ``count`` is called for each photo.
    """
    arriving = arrange(described, arrangement)
    verified_pairs = 0
    with TemporaryDirectory(prefix="sfm_front_tuning_") as folder:
        started = process_time()
        with Session(Path(folder), options) as session:
            for photo in arriving:
                added = session.add_extracted(photo)
                if isinstance(added, PhotoAdded):
                    verified_pairs += len(added.verified)
                count()
            models = [model.path for model in session.finish().models]
        seconds = process_time() - started
        quality = assess(models, limited_to(scene, [photo.name for photo in arriving]))
    return Trial(
        scene=scene.name,
        arrangement=arrangement,
        photos=len(arriving),
        quality=quality,
        verified_pairs=verified_pairs,
        seconds=seconds,
    )
