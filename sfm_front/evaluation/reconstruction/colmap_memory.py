"""What pycolmap's correspondence graph and models of an output take. Run as a process, with OUTPUT.

In the process of a session their memory cannot be told from the rest.
"""

from __future__ import annotations

import subprocess
import sys
import zlib  # noqa: F401  Before pycolmap, which exports one of its own.
from pathlib import Path

from sfm_front.evaluation.process import resident_bytes
from sfm_front.runtime.subprocess_env import module_command, module_environment


def colmap_memory_bytes(output: Path) -> int | None:
    """Have a process of its own load both, as a session holds them; None without /proc."""
    done = subprocess.run(
        module_command(__name__, str(output)),
        env=module_environment(),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return int(done.stdout) if done.stdout.strip() else None


def _main(output: Path) -> None:
    from sfm_front.geometry.lenses import take_intrinsics
    from sfm_front.mapping.view_graph import ViewGraph
    from sfm_front.storage.colmap_models import read_model
    from sfm_front.storage.database import DATABASE, PhotoDatabase

    view_graph = ViewGraph()
    before = resident_bytes()
    with PhotoDatabase(output / DATABASE) as database:
        cameras = database.cameras()
        for photo in database.photos():
            keypoints, _ = database.keypoints(photo.image_id)
            pairs = database.pairs(photo.image_id)
            camera = cameras[photo.camera_id]
            view_graph.add(photo.image_id, photo.name, camera, keypoints, pairs)
    held = []
    for folder in sorted(path for path in (output / "sparse").iterdir() if path.is_dir()):
        model = read_model(folder)
        for camera_id, camera in model.cameras.items():
            # Its lens may have grown at the end; graph and models have the same while photos come.
            take_intrinsics(camera, cameras[camera_id])
        held.append(view_graph.new_mapper(model))
    after = resident_bytes()
    if before is not None and after is not None:
        print(after - before)
    del held


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
