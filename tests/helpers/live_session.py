"""Sessions on synthetic photos, with pictures of them, that a live page can follow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from helpers.photo_stream import described
from helpers.positioned_stream import measured, options, positions_at
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.session.session import Session
from sfm_front.types import Exif, ExtractedPhoto

HOSTILE = "<img src=x onerror=window.harm=1>\"'`${{}}\x1b[31m\u202egpj.jpg"
"""A photo's name that would run a script, break markup, or colour a terminal."""


def orbit(num_photos: int) -> SyntheticScene:
    """A flight round some points."""
    return make_scene(num_photos, 400, seed=1, layout="orbit", outlier_ratio=0.05)


def photos_of(
    scene: SyntheticScene,
    folder: Path,
    names: Mapping[int, str] | None = None,
    *,
    has_positions: bool = True,
) -> Iterator[ExtractedPhoto]:
    """The photos of a scene with pictures in ``folder``, one colour each; ``names`` of some."""
    folder.mkdir(exist_ok=True)
    positions = positions_at(measured(scene))
    for index in range(len(scene)):
        photo = described(scene, index)
        file = folder / f"{index:03d}.png"
        color = tuple(np.random.default_rng(index).integers(40, 220, 3).tolist())
        Image.new("RGB", (64, 48), color).save(file)
        yield replace(
            photo,
            name=(names or {}).get(index, photo.name),
            path=file,
            exif=Exif(position=positions[index] if has_positions else None),
        )


def run_session(output: Path, photos: Iterator[ExtractedPhoto], *, finish: bool = True) -> Path:
    """Take in all photos; returns ``output``."""
    with Session(output, options()) as session:
        for photo in photos:
            session.add_extracted(photo)
        if finish:
            session.finish()
    return output
