"""Accuracy of camera poses: errors of relative poses over pairs of photos, and their AUC.

The measure of the Image Matching Challenge (Jin et al., "Image Matching across Wide Baselines",
IJCV 2021): it needs no alignment of the model to the ground truth, and missing photos count.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import InputError
from sfm_front.types import Float64Array

if TYPE_CHECKING:
    import pycolmap

AUC_THRESHOLDS_DEG = (1.0, 3.0, 5.0)


def pose_errors(
    truth: pycolmap.Reconstruction,
    models: Sequence[pycolmap.Reconstruction],
    pairs: Iterable[tuple[str, str]] | None = None,
) -> Float64Array:
    """(P,) float64: the error of each pair's relative pose in degrees, in [0, 180] or infinite.

    The error is the larger of the angle between the rotations and the angle between the
    directions of the translations. It is infinite if no model holds both photos; if several do,
    the largest model counts. ``pairs`` names photos of ``truth``; by default all of its pairs.
    Names are compared without regard to case. Raises ``InputError`` if ``truth`` lacks a photo of
    ``pairs`` or has names that differ only in case.
    """
    true_poses = _poses_by_name(truth)
    names = list(true_poses)
    index = {name: i for i, name in enumerate(names)}
    if pairs is None:
        chosen = list(combinations(range(len(names)), 2))
    else:
        try:
            chosen = [(index[a.casefold()], index[b.casefold()]) for a, b in pairs]
        except KeyError as error:
            raise InputError(
                f"the ground truth has no pose of {error}; remove its pairs from the list"
            ) from error
    first, second = np.array(chosen, dtype=np.intp).reshape(-1, 2).T

    errors = np.full(len(chosen), np.inf)
    for model in sorted(models, key=lambda model: model.num_reg_images()):
        poses = _poses_by_name(model)
        both = np.array([name in poses for name in names], dtype=bool)
        here = both[first] & both[second]
        placed = {name: poses.get(name, true_poses[name]) for name in names}
        errors[here] = np.maximum(
            *_angles_deg(
                _relative(true_poses, names, first[here], second[here]),
                _relative(placed, names, first[here], second[here]),
            )
        )
    return errors


def auc(errors: Float64Array, thresholds: Sequence[float] = AUC_THRESHOLDS_DEG) -> list[float]:
    """Area under the recall curve up to each threshold, divided by the threshold: in [0, 1].

    The curve joins (0, 0) and, for the i-th smallest of n errors, (error, i / n) by straight
    lines and is level from the last error below the threshold to the threshold; its area is
    exact. Infinite errors are never recalled. Raises ``ValueError`` if ``errors`` is empty.
    """
    if not len(errors):
        raise ValueError("no errors: the area under their curve is undefined")
    ordered = np.concatenate([[0.0], np.sort(errors)])
    recall = np.arange(len(ordered)) / len(errors)
    areas = []
    for threshold in thresholds:
        below = int(np.searchsorted(ordered, threshold, side="left"))
        at = np.append(ordered[:below], threshold)
        height = np.append(recall[:below], recall[below - 1])
        areas.append(float(np.diff(at) @ (height[1:] + height[:-1])) / (2 * threshold))
    return areas


_Pose = tuple[Float64Array, Float64Array]


def _poses_by_name(model: pycolmap.Reconstruction) -> dict[str, _Pose]:
    """Rotation (3, 3), camera from world, and centre (3,) of each registered photo, by name."""
    poses: dict[str, _Pose] = {}
    for image_id in model.reg_image_ids():
        image = model.images[image_id]
        name = image.name.casefold()
        if name in poses:
            raise InputError(f"two photos are named {image.name}, ignoring case; rename one")
        poses[name] = (image.cam_from_world().rotation.matrix(), image.projection_center())
    return poses


def _relative(
    poses: dict[str, _Pose], names: list[str], first: NDArray[np.intp], second: NDArray[np.intp]
) -> _Pose:
    """Rotations (P, 3, 3) and translations (P, 3) of cam2_from_cam1."""
    rotations = np.array([poses[name][0] for name in names])
    centres = np.array([poses[name][1] for name in names])
    cam2_from_cam1 = rotations[second] @ rotations[first].transpose(0, 2, 1)
    baselines = centres[first] - centres[second]
    return cam2_from_cam1, np.einsum("pij,pj->pi", rotations[second], baselines)


def _angles_deg(truth: _Pose, found: _Pose) -> tuple[Float64Array, Float64Array]:
    """Angles (P,) between rotations and between directions of translations, in degrees.

    Both formulas are precise at small angles, where the arc cosine is not. Photos taken from one
    place have no true direction, hence no error in it; photos wrongly placed at one point have the
    largest.
    """
    chord = np.linalg.norm(truth[0] - found[0], axis=(1, 2)) / (2 * np.sqrt(2))
    rotation = 2 * np.arcsin(np.clip(chord, 0, 1))
    cross = np.linalg.norm(np.cross(truth[1], found[1]), axis=1)
    direction = np.arctan2(cross, np.einsum("pi,pi->p", truth[1], found[1]))
    direction[_vanishes(found[1])] = np.pi
    direction[_vanishes(truth[1])] = 0
    return np.degrees(rotation), np.degrees(direction)


def _vanishes(baselines: Float64Array) -> NDArray[np.bool_]:
    """(P,): whether a baseline is only rounding error compared to the longest."""
    lengths = np.linalg.norm(baselines, axis=1)
    nothing: NDArray[np.bool_] = lengths <= 1e-9 * lengths.max(initial=0.0)
    return nothing
