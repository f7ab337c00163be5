"""Which photos of a model observe which of its points, and the tree of those that share most."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.types import Float64Array

BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Covisibility:
    """The N registered photos of a model and P of its points.

    ``image_ids`` (N,), sorted. ``points`` (P, 3): in world coordinates. ``observed``: for each
    photo the indices of the points it observes, sorted.
    """

    image_ids: IndexArray
    points: Float64Array
    observed: tuple[IndexArray, ...]

    @classmethod
    def of(cls, reconstruction: pycolmap.Reconstruction, *, min_observers: int) -> Covisibility:
        """With the points that at least ``min_observers`` keypoints show."""
        known = {
            point_id: point
            for point_id, point in sorted(reconstruction.points3D.items())
            if point.track.length() >= min_observers
        }
        index_of = {point_id: index for index, point_id in enumerate(known)}
        image_ids = sorted(reconstruction.reg_image_ids())
        return cls(
            np.array(image_ids, np.int64),
            np.array([point.xyz for point in known.values()], np.float64).reshape(-1, 3),
            tuple(
                np.unique(
                    np.array(
                        [
                            index
                            for point in reconstruction.image(i).get_observation_points2D()
                            if (index := index_of.get(point.point3D_id)) is not None
                        ],
                        np.int64,
                    )
                )
                for i in image_ids
            ),
        )

    def sharing(self) -> Sharing:
        """Which photos share points."""
        num_photos = len(self.image_ids)
        photo = np.repeat(np.arange(num_photos), [len(seen) for seen in self.observed])
        point = np.concatenate([*self.observed, np.zeros(0, np.int64)])
        observers = photo[np.argsort(point, kind="stable")]
        track_length = np.bincount(point, minlength=len(self.points))
        end = np.cumsum(track_length)
        others, counts = [], []
        for number, seen in enumerate(self.observed):
            length = track_length[seen]
            # Places in ``observers`` of all tracks of the photo's points, one after another.
            places = np.arange(length.sum()) + np.repeat(end[seen] - np.cumsum(length), length)
            shared = np.bincount(observers[places], minlength=num_photos)
            shared[number] = 0
            others.append(np.flatnonzero(shared))
            counts.append(shared[others[-1]])
        own = np.array([len(seen) for seen in self.observed], np.int64)
        return Sharing(own, tuple(others), tuple(counts))

    def seen_by(self, photos: BoolArray) -> BoolArray:
        """(P,) whether any of the photos (N,) observes a point."""
        seen = np.zeros(len(self.points), np.bool_)
        for number in np.flatnonzero(photos):
            seen[self.observed[number]] = True
        return seen


@dataclass(frozen=True, eq=False)
class Sharing:
    """How many points each of N photos observes, ``own`` (N,); for each the ``others`` that share
    some of them, sorted, and how many, ``counts``. A flight's photos share with few others each."""

    own: IndexArray
    others: tuple[IndexArray, ...]
    counts: tuple[IndexArray, ...]

    def pairs(self, min_shared: int) -> IndexArray:
        """(K, 2) photos that share so many points, those that share most first."""
        first = np.repeat(np.arange(len(self.own)), [len(others) for others in self.others])
        second = np.concatenate([*self.others, np.zeros(0, np.int64)])
        counts = np.concatenate([*self.counts, np.zeros(0, np.int64)])
        kept = np.flatnonzero((first < second) & (counts >= min_shared))
        kept = kept[np.argsort(-counts[kept], kind="stable")]
        return np.column_stack([first[kept], second[kept]])

    def halves(self) -> Iterator[BoolArray]:
        """The two parts that each edge of a spanning tree joins: (N,) True for the photos beyond
        it. The tree joins photos that share most of what either observes."""
        num_photos = len(self.own)
        if num_photos == 0:
            return
        # Of the photos not in the tree: the nearest that is, and the overlap with it; else -1.
        nearest, closest = np.zeros(num_photos, np.int64), np.zeros(num_photos)
        order, photo = [], 0
        for _ in range(num_photos - 1):
            closest[photo] = -1
            others, shared = self.others[photo], self.counts[photo]
            overlap = shared / (self.own[photo] + self.own[others] - shared)
            closer = (overlap > closest[others]) & (closest[others] >= 0)
            nearest[others[closer]], closest[others[closer]] = photo, overlap[closer]
            photo = int(np.argmax(closest))
            order.append(photo)
        beyond = np.eye(num_photos, dtype=np.bool_)
        for photo in reversed(order):
            beyond[nearest[photo]] |= beyond[photo]
            yield beyond[photo]


def parts(image_ids: IndexArray, beyond: BoolArray) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Image ids of the photos ``beyond`` (N,) an edge and of the others, the larger part first."""
    both = [tuple(image_ids[part].tolist()) for part in (beyond, ~beyond)]
    both.sort(key=len, reverse=True)
    return both[0], both[1]
