"""Small photo files of textured scenes, for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

WIDTH, HEIGHT = 320, 240


def scene(seed: int) -> Image.Image:
    """A picture of 460 x 340 with texture at several scales, different for each seed."""
    rng = np.random.default_rng(seed)
    total = np.zeros((340, 460, 3))
    for cells, strength in ((12, 1.0), (30, 0.9), (80, 0.7)):
        coarse = rng.integers(0, 256, (cells * 3 // 4, cells, 3), dtype=np.uint8)
        fine = Image.fromarray(coarse).resize((460, 340), Image.Resampling.BICUBIC)
        total += strength * np.asarray(fine, float)
    low, high = total.min(), total.max()
    return Image.fromarray(((total - low) / (high - low) * 255).astype(np.uint8))


def photo(seed: int, shift: int) -> Image.Image:
    """A photo of the scene ``seed``, ``shift`` (0 to 140) pixels to the right."""
    return scene(seed).crop((shift, 50, shift + WIDTH, 50 + HEIGHT))


def save(folder: Path, *names: str) -> list[Path]:
    """Save the photos named ``SEED_SHIFT.png``; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name in names:
        seed, shift = Path(name).stem.split("_")
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        photo(int(seed), int(shift)).save(path)
        paths.append(path)
    return paths
