"""What pycolmap reads of an output. Run as a process of its own, with DATABASE and SPARSE.

pycolmap and Python each bring an SQLite: two of them must not open one file in one process.
"""

from __future__ import annotations

import json
import subprocess
import sys
import zlib  # noqa: F401  Before pycolmap, which exports one of its own.
from dataclasses import dataclass
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.runtime.subprocess_env import module_command, module_environment


@dataclass(frozen=True)
class ColmapView:
    """Image id → name in the database, and the number of its keypoints; the same of each model.

    ``broken`` says what cannot be read.
    """

    images: dict[int, tuple[str, int]]
    models: dict[str, dict[int, tuple[str, int]]]
    broken: tuple[str, ...]


def colmap_view(database: Path, sparse: Path) -> ColmapView:
    """Have a process of its own read both; either may be missing."""
    done = subprocess.run(
        module_command(__name__, str(database), str(sparse)),
        env=module_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["without a word"])[-1]
        return ColmapView({}, {}, (f"pycolmap ends with status {done.returncode}: {last}",))
    content = json.loads(done.stdout)
    return ColmapView(
        _by_id(content["images"]),
        {name: _by_id(images) for name, images in content["models"].items()},
        tuple(content["broken"]),
    )


def _by_id(images: dict[str, list[str | int]]) -> dict[int, tuple[str, int]]:
    return {int(i): (str(name), int(count)) for i, (name, count) in images.items()}


def _main(database: Path, sparse: Path) -> None:
    import pycolmap

    from sfm_front.storage.colmap_models import read_model

    images, models, broken = {}, {}, []
    if database.exists():
        try:
            with pycolmap.Database.open(database) as opened:
                for image in opened.read_all_images():
                    count = opened.num_keypoints_for_image(image.image_id)
                    images[image.image_id] = (image.name, count)
        except (RuntimeError, ValueError) as error:
            broken.append(f"pycolmap cannot read the database: {error}")
    for folder in sorted(filter(Path.is_dir, sparse.glob("*"))):
        try:
            model = read_model(folder)
        except InputError as error:
            broken.append(str(error))
            continue
        models[folder.name] = {
            i: (model.images[i].name, len(model.images[i].points2D)) for i in model.reg_image_ids()
        }
    print(json.dumps({"images": images, "models": models, "broken": broken}))


if __name__ == "__main__":
    _main(Path(sys.argv[1]), Path(sys.argv[2]))
