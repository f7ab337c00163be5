"""Which waiting photo a model tries to register next."""

from __future__ import annotations

from collections.abc import Iterable

import pycolmap


class NextImage:
    """Chooses photos that see enough of a model, and leaves those alone that failed and see hardly
    more since."""

    def __init__(self, retry_growth: float) -> None:
        """``retry_growth``: a photo that failed is tried again once it sees so many times the
        points."""
        self._retry_growth = retry_growth
        self._seen_at_failure: dict[int, int] = {}

    def best(
        self,
        observations: pycolmap.ObservationManager,
        waiting: Iterable[int],
        min_visible: int,
    ) -> int | None:
        """The one with the best spread of visible points over the photo, as COLMAP ranks them, of
        those that see ``min_visible``; None if no trial is worth it."""
        best: tuple[int, int] | None = None
        for image_id in waiting:
            num_visible = observations.num_visible_points3D(image_id)
            if num_visible < min_visible:
                continue
            if num_visible < self._retry_growth * self._seen_at_failure.get(image_id, 0):
                continue
            rank = (observations.point3D_visibility_score(image_id), -image_id)
            if best is None or rank > best:
                best = rank
        return None if best is None else -best[1]

    def failed(self, image_id: int, num_visible: int) -> None:
        """It was tried, with so many points visible."""
        self._seen_at_failure[image_id] = num_visible

    def forget_failures(self) -> None:
        """Allow every photo to be tried again."""
        self._seen_at_failure.clear()
