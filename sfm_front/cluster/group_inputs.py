"""What a worker needs to grow models of a group: read from the session's database."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sfm_front.cluster.work import GroupPhoto, GroupWork
from sfm_front.matching.nearest_neighbors import NO_MATCHES
from sfm_front.session.given import GivenSession


class GroupInputs:
    """Of any photos of a session."""

    def __init__(self, session: GivenSession) -> None:
        self._session = session

    def of(self, image_ids: Sequence[int]) -> GroupWork:
        """These photos, in order of arrival, and the verified pairs among them."""
        session, members = self._session, set(image_ids)
        cameras = {image_id: session.camera(image_id) for image_id in image_ids}
        photos = tuple(
            GroupPhoto(
                image_id,
                session.name(image_id),
                cameras[image_id].camera_id,
                np.ascontiguousarray(session.database.keypoints(image_id)[0][:, :2]),
            )
            for image_id in image_ids
        )
        pairs = {
            image_id: tuple(
                replace(pair, matches=NO_MATCHES)  # a view graph has no use for others
                for pair in session.database.pairs(image_id)
                if pair.image_id2 in members
            )
            for image_id in image_ids
        }
        return GroupWork(photos, {c.camera_id: c for c in cameras.values()}, pairs)
