"""Small runs on a cluster of this machine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from helpers.locations import VILLAGE
from sfm_front.cluster.connection import Cluster
from sfm_front.cluster.coordinator import ClusterProgress, Coordinator
from sfm_front.cluster.options import ClusterOptions
from sfm_front.events import Listener
from sfm_front.features.sift import SiftOptions
from sfm_front.photos.source import list_photos
from sfm_front.session.given import GivenSession
from sfm_front.session.options import SessionOptions
from sfm_front.session.summing_up import SessionResult
from sfm_front.types import PhotoPath

SMALL = SessionOptions(
    max_image_size=640, max_features=1500, global_descriptor="vlad", sift=SiftOptions(), threads=2
)
# Two groups of the village's 21 photos.
GROUPS = ClusterOptions(address="local:2", group_size=12)


def village() -> list[PhotoPath]:
    """Its photos, by name."""
    return list_photos(VILLAGE / "images")


def run(
    cluster: Cluster,
    output: Path,
    photos: Sequence[PhotoPath],
    *,
    options: ClusterOptions = GROUPS,
    resume: bool = False,
    on_progress: Callable[[ClusterProgress], None] = lambda _: None,
    on_event: Listener | None = None,
    is_stopped: Callable[[], bool] = lambda: False,
) -> SessionResult:
    """A whole run with those of the photos that the output does not hold."""
    with GivenSession(output, SMALL, resume=resume, on_event=on_event) as session:
        known = {photo.name for photo in session.database.photos()}
        new = [photo for photo in photos if photo.name not in known]
        return Coordinator(session, cluster, options, new, on_progress).run(is_stopped)
