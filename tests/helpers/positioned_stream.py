"""Photos of synthetic scenes with measured positions: the world of a scene is ENU at ``FRAME``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pycolmap

from helpers.photo_stream import centre_of, described
from sfm_front.evaluation.synthetic.scene import SyntheticScene
from sfm_front.geometry.enu import LocalFrame
from sfm_front.mapping.atlas import AtlasOptions
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.session.options import SessionOptions
from sfm_front.types import Exif, ExtractedPhoto, Float64Array, GeoPosition

FRAME = LocalFrame(46.84, -91.99, 300.0)
NOISE_M = (0.5, 0.5, 1.0)
_SECONDS_BETWEEN_PHOTOS = 3


def options(**changes: object) -> SessionOptions:
    atlas = AtlasOptions(mapper=MapperOptions(num_threads=1))
    defaults = {"global_descriptor": "vlad", "threads": 1, "atlas": atlas}
    return SessionOptions(**(defaults | changes))


def true_centres(scene: SyntheticScene) -> Float64Array:
    """(N, 3) metres in the world of the scene."""
    return np.array([centre_of(pose) for pose in scene.cams_from_world])


def measured(scene: SyntheticScene, seed: int = 0) -> Float64Array:
    """(N, 3) the same, as GPS measures them."""
    noise = np.random.default_rng(seed).normal(size=(len(scene), 3)) * NOISE_M
    return true_centres(scene) + noise


def positions_at(enu: Float64Array) -> list[GeoPosition]:
    """What cameras at these places (N, 3) write; no altitude where the height is nan."""
    rows = FRAME.to_wgs84(np.nan_to_num(enu))
    known = np.isfinite(enu[:, 2])
    return [
        GeoPosition(lat, lon, alt if has_height else None)
        for (lat, lon, alt), has_height in zip(rows.tolist(), known.tolist(), strict=True)
    ]


def taken(
    scene: SyntheticScene, positions: Sequence[GeoPosition | None], *, prefix: str = ""
) -> list[ExtractedPhoto]:
    """The photos of a scene with these positions, one every three seconds."""
    start = datetime(2024, 5, 1, 12)
    return [
        replace(
            described(scene, index, prefix=prefix),
            exif=Exif(
                position=position,
                captured_at=start + timedelta(seconds=_SECONDS_BETWEEN_PHOTOS * index),
            ),
        )
        for index, position in enumerate(positions)
    ]


def centres_in_enu(
    folder: Path, frame: LocalFrame, scene: SyntheticScene, *, prefix: str = ""
) -> tuple[Float64Array, Float64Array]:
    """Camera centres of a model in ``folder`` that is in ENU at ``frame``, moved to that at
    ``FRAME`` and no further, and the true ones: (M, 3) each, of the photos with this prefix."""
    model = pycolmap.Reconstruction(folder)
    index_of = {prefix + scene.name(index): index for index in range(len(scene))}
    images = [model.images[i] for i in model.reg_image_ids() if model.images[i].name in index_of]
    found = np.array([image.projection_center() for image in images]).reshape(-1, 3)
    truth = true_centres(scene)[[index_of[image.name] for image in images]]
    return FRAME.to_enu(frame.to_wgs84(found)), truth
