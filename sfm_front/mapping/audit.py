"""How far the verified pairs of a model agree with its poses.

A pair's own relative pose would be no judge: without a known focal length it is off by tens of
degrees on sound models. Its matches are, whatever the focal length was thought to be.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.geometry.epipolar_error import fits_epipolar
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.geometry.rays import undistorted_rays
from sfm_front.mapping.covisibility import (
    BoolArray,
    Covisibility,
    IndexArray,
    parts,
)
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import Float64Array, Uint32Array

# Pixels that a match of a pair may be off the epipolar line: twice what verification allows, for
# the poses have an error too.
_MAX_ERROR_PX = 8.0
# Share of a pair's matches from which it agrees with the model, and up to which it contradicts it
# (TUNING: contradicted).
_AGREES = 0.5
_CONTRADICTS = 0.25
# Share of a model's matches in pairs that contradict it from which a user should look at it.
_DOUBTFUL = 0.01
# Matches of a pair by which an audit judges it, evenly chosen.
_SAMPLE = 32


@dataclass(frozen=True, slots=True)
class ModelAudit:
    """What the verified pairs of a model say of it.

    ``num_contradicted`` of the ``num_pairs`` contradict its poses, with a share of
    ``contradicted_share`` of all matches. ``worst_parts``: image ids of the two parts of the model,
    the larger first, of whose matches the pairs that contradict it have the largest share,
    ``worst_share``; None if the model is not doubtful.
    """

    num_pairs: int
    num_contradicted: int
    contradicted_share: float
    worst_parts: tuple[tuple[int, ...], tuple[int, ...]] | None
    worst_share: float

    @property
    def is_doubtful(self) -> bool:
        """Whether so much speaks against the model that somebody should look at it."""
        return self.contradicted_share >= _DOUBTFUL


def audit(reconstruction: pycolmap.Reconstruction, view_graph: ViewGraph) -> ModelAudit:
    """Compare a model with the verified pairs of its photos."""
    found = _Verdicts.of(reconstruction, view_graph)
    contradicted_share = float(found.against.sum() / max(1, found.num_matches.sum()))
    worst, worst_share = None, 0.0
    if contradicted_share >= _DOUBTFUL:
        covisibility = Covisibility.of(reconstruction, min_observers=2)
        image_ids = covisibility.image_ids
        ends = np.searchsorted(image_ids, found.pairs)
        for beyond in covisibility.sharing().halves():
            crossing = beyond[ends[:, 0]] != beyond[ends[:, 1]]
            share = found.against[crossing].sum() / max(1, found.speaking[crossing].sum())
            if share > worst_share:
                worst, worst_share = parts(image_ids, beyond), float(share)
    return ModelAudit(
        num_pairs=len(found.pairs),
        num_contradicted=int(np.count_nonzero(found.against)),
        contradicted_share=contradicted_share,
        worst_parts=worst,
        worst_share=worst_share,
    )


def misplaced(
    reconstruction: pycolmap.Reconstruction, view_graph: ViewGraph
) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """The others, and a photo or two linked ones that most of their matches want elsewhere: image
    ids. None if there are none.

    They are too few to have surroundings of their own. Of more photos the majority says nothing:
    where two things look alike, most matches are wrong.
    """
    found = _Verdicts.of(reconstruction, view_graph)
    if not found.against.any():
        return None
    image_ids = np.unique(found.pairs)
    ends = np.searchsorted(image_ids, found.pairs)
    against, speaking = (
        np.bincount(ends.ravel(), np.repeat(matches, 2))
        for matches in (found.against, found.speaking)
    )
    of_one = against / np.maximum(1, speaking)
    # The matches that two photos have with each other say nothing of where both stand.
    of_two = (against[ends].sum(axis=1) - 2 * found.against) / np.maximum(
        1, speaking[ends].sum(axis=1) - 2 * found.speaking
    )
    if max(of_one.max(), of_two.max()) <= 0.5:
        return None
    beyond = np.zeros(len(image_ids), np.bool_)
    beyond[of_one.argmax() if of_one.max() >= of_two.max() else ends[of_two.argmax()]] = True
    return parts(image_ids, beyond)


@dataclass(frozen=True, slots=True, eq=False)
class _Verdicts:
    """The K verified pairs of a model: ``pairs`` (K, 2) image ids, ``num_matches`` (K,), of which
    those of pairs that contradict it count in ``against``, and of pairs that say anything in
    ``speaking``."""

    pairs: IndexArray
    num_matches: Float64Array
    against: Float64Array
    speaking: Float64Array

    @classmethod
    def of(cls, reconstruction: pycolmap.Reconstruction, view_graph: ViewGraph) -> _Verdicts:
        pairs = view_graph.pairs(reconstruction.reg_image_ids())
        found = [
            (view_graph.num_matches(pair), agrees.mean())
            for pair, _, agrees in agreeing(reconstruction, view_graph, pairs, at_most=_SAMPLE)
        ]
        num_matches, shares = np.array(found, np.float64).reshape(-1, 2).T
        against = np.where(shares <= _CONTRADICTS, num_matches, 0)
        speaking = against + np.where(shares >= _AGREES, num_matches, 0)
        return cls(np.array(pairs, np.int64).reshape(-1, 2), num_matches, against, speaking)


def agreeing(
    reconstruction: pycolmap.Reconstruction,
    view_graph: ViewGraph,
    pairs: Iterable[tuple[int, int]],
    *,
    at_most: int | None = None,
) -> Iterator[tuple[tuple[int, int], Uint32Array, BoolArray]]:
    """Verified pairs of registered photos, their matches (M, 2), and which of these (M,) lie where
    the poses of the model put them; or no more than ``at_most`` of the matches of each."""
    for pair in pairs:
        matches = view_graph.matches(*pair)
        if at_most is not None:
            matches = matches[:: -(-len(matches) // at_most)]
        posed: list[PosedCamera] = []
        rays: list[Float64Array] = []
        for image_id, indices in zip(pair, matches.T, strict=True):
            image = reconstruction.image(image_id)
            camera = reconstruction.camera(image.camera_id)
            posed.append(PosedCamera(camera, image.cam_from_world()))
            pixels = np.array([image.point2D(index).xy for index in indices.tolist()], np.float64)
            rays.append(undistorted_rays(camera, pixels))
        focal_px = 0.5 * sum(one.camera.mean_focal_length() for one in posed)
        essential = pycolmap.essential_matrix_from_pose(posed[0].relative(posed[1]))
        first, second = rays
        yield pair, matches, fits_epipolar(essential, first, second, _MAX_ERROR_PX / focal_px)
