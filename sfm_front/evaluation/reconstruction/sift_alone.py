"""A lower bound: the seconds that OpenCV's SIFT alone takes on a folder of photos.

Run as a module, it is the process that ``sift_alone_seconds`` starts. Arguments: TASK.json
RESULT.json.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from time import perf_counter

from sfm_front.errors import SfmFrontError
from sfm_front.evaluation.process import measure
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings
from sfm_front.runtime.subprocess_env import module_command


def sift_alone_seconds(photos: Path, workspace: Path, settings: BenchmarkSettings) -> float:
    """Detection and description of every photo, one after the other, with OpenCV's threads.

    Reading and resizing do not count. Runs in a fresh process with files in ``workspace``.
    """
    workspace.mkdir(parents=True, exist_ok=True)
    task, result = workspace / "task.json", workspace / "result.json"
    task.write_text(
        json.dumps(
            {
                "photos": str(photos),
                "max_image_size": settings.max_image_size_px,
                "max_features": settings.max_features,
                "threads": settings.threads,
            }
        )
    )
    command = module_command(
        "sfm_front.evaluation.reconstruction.sift_alone", str(task), str(result)
    )
    measured = measure(command, workspace / "log.txt")
    if measured.return_code:
        raise SfmFrontError(f"OpenCV's SIFT failed on {photos}: {measured.last_line}")
    return float(json.loads(result.read_text())["seconds"])


def main(task: Path, result: Path) -> None:
    """Run on the photos named in the file ``task``; write the seconds to the file ``result``."""
    import cv2

    from sfm_front.photos.reader import PhotoReader
    from sfm_front.photos.source import list_photos
    from sfm_front.types import Skipped

    given = json.loads(task.read_text())
    cv2.setNumThreads(given["threads"])
    reader = PhotoReader(max_image_size=given["max_image_size"])
    seconds = 0.0
    for file in list_photos(Path(given["photos"])):
        photo = reader.read(file.path, file.name)
        if isinstance(photo, Skipped):
            continue
        gray = cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY)
        started = perf_counter()
        sift = cv2.SIFT.create(nfeatures=given["max_features"], enable_precise_upscale=True)
        sift.detectAndCompute(gray, None)
        seconds += perf_counter() - started
    result.write_text(json.dumps({"seconds": seconds}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
