"""What became of one photo of a finished output, and why, read back from its files."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.errors import InputError
from sfm_front.matching.nearest_neighbors import MatchingOptions, match_descriptors
from sfm_front.matching.verification import Verifier
from sfm_front.reports.position_explanation import position_in_words
from sfm_front.reports.report_json import read_report
from sfm_front.reports.retrieval_log import read_candidates
from sfm_front.reports.run_summary import Outcome, RunSummary
from sfm_front.reports.words import one_line
from sfm_front.storage.colmap_models import read_model
from sfm_front.storage.database import DATABASE, PhotoDatabase
from sfm_front.types import CandidateOutcome, Features, Float64Array, Skipped, Uint32Array, View


@dataclass(frozen=True, slots=True)
class CandidateVerdict:
    """A candidate as re-ranked: ``inliers`` of re-ranking, None if it was not looked at.

    ``num_verified`` and ``num_matches``: inliers and tentative matches of the verified pair, None
    if there is none; ``rejected`` says why not, empty if the pair was not matched.
    """

    name: str
    cosine: float
    inliers: int | None
    num_verified: int | None
    num_matches: int | None
    rejected: str


@dataclass(frozen=True, slots=True)
class Explanation:
    """One photo's way: ``candidates`` before it arrived, and verified pairs with ``others``.

    ``skipped`` is the reason if the file was not used; ``model`` the folder of the largest model
    that holds the photo, with the number of its points that it sees; ``why_not`` what kept it out,
    and ``hint`` what would help. ``position``: what became of where it was measured to be, empty if
    nothing is known.
    """

    name: str
    skipped: str
    num_keypoints: int
    candidates: tuple[CandidateVerdict, ...]
    others: Mapping[str, int]
    model: str | None
    num_points: int
    why_not: str
    hint: str
    position: str = ""

    def __str__(self) -> str:
        if self.skipped:
            return f"{self.name}: skipped, {self.skipped}"
        placed = (
            f"placed in {self.model}, sees {self.num_points} of its points"
            if self.model
            else f"not placed: {self.why_not}"
        )
        lines = [f"{self.name}: {placed}"]
        if self.hint:
            lines.append(self.hint)
        if self.position:
            lines.append(self.position)
        lines.append(f"{self.num_keypoints} keypoints")
        if self.candidates:
            lines.append("candidates, as re-ranked (cosine, inliers of re-ranking, verdict):")
        else:
            lines.append("no candidates: it came first")
        for candidate in self.candidates:
            inliers = "-" if candidate.inliers is None else str(candidate.inliers)
            lines.append(
                f"  {candidate.name}  {candidate.cosine:.3f}  {inliers:>4}  {_verdict(candidate)}"
            )
        if self.others:
            lines.append("verified with others, that came later or on a second look (inliers):")
            lines += [f"  {name}  {inliers}" for name, inliers in self.others.items()]
        return "\n".join(map(one_line, lines))


@dataclass(frozen=True, slots=True, eq=False)
class PairMatches:
    """Tentative matches of two photos: ``xy1``, ``xy2`` (M, 2) in pixels of the files, whose
    ``sizes`` are (width, height); ``is_inlier`` (M,).

    ``verified``: whether they are those of a verified pair, or were matched again with default
    options, because nothing is kept of rejected pairs.
    """

    xy1: Float64Array
    xy2: Float64Array
    is_inlier: NDArray[np.bool_]
    sizes: tuple[tuple[int, int], tuple[int, int]]
    verified: bool


def explain(output: Path, name: str) -> Explanation:
    """Read what became of the photo called ``name`` from a finished output.

    Raises InputError if the output is not a finished one, or has no such photo.
    """
    summary = read_report(output)
    photo = _photo(summary, name, output)
    if isinstance(photo, Skipped):
        return Explanation(name, str(photo), 0, (), {}, None, 0, "", "")
    with pycolmap.Database.open(output / DATABASE) as database:
        ids = {image.name: image.image_id for image in database.read_all_images()}
        candidates = tuple(
            _verdict_of(database, ids, name, candidate)
            for candidate in read_candidates(output, name)
        )
        known = {c.name for c in candidates if c.num_verified is not None}
        others = {
            other: inliers
            for other, image_id in ids.items()
            if other not in known and (inliers := _num_inliers(database, ids[name], image_id))
        }
    model = None if photo.model is None else summary.models[photo.model].path
    return Explanation(
        name=name,
        skipped="",
        num_keypoints=photo.num_keypoints,
        candidates=candidates,
        others=others,
        model=model,
        num_points=0 if model is None else _num_points(output / model, ids[name]),
        why_not=photo.why_not or "",
        hint=photo.hint,
        position=position_in_words(output, summary, photo),
    )


def photo_files(output: Path) -> dict[str, Path]:
    """Where the photos of an output were when they were taken in, by name."""
    with PhotoDatabase(output / DATABASE) as database:
        return {photo.name: photo.path for photo in database.photos()}


def pair_matches(output: Path, name1: str, name2: str) -> PairMatches:
    """Tentative matches of two photos and which of them are inliers.

    Raises InputError if the database lacks one of the photos.
    """
    with pycolmap.Database.open(output / DATABASE) as database:
        images = {image.name: image for image in database.read_all_images()}
        for name in (name1, name2):
            if name not in images:
                raise InputError(f"{output}: {name} is not in its database: nothing to draw")
        view1, view2 = (_view(database, images[name]) for name in (name1, name2))
        ids = view1.image_id, view2.image_id
        verified = bool(database.exists_two_view_geometry(*ids))
        if verified:
            matches = np.asarray(database.read_matches(*ids))
            inliers = np.asarray(database.read_two_view_geometry(*ids).inlier_matches)
        else:
            descriptors = view1.features.descriptors, view2.features.descriptors
            matches = match_descriptors(*descriptors, MatchingOptions())
            inliers = Verifier().inliers(view1, view2, matches)
    return PairMatches(
        view1.points(matches[:, 0]),
        view2.points(matches[:, 1]),
        _among(matches, inliers),
        ((view1.camera.width, view1.camera.height), (view2.camera.width, view2.camera.height)),
        verified,
    )


def _view(database: pycolmap.Database, image: pycolmap.Image) -> View:
    keypoints = np.asarray(database.read_keypoints(image.image_id), np.float32)
    descriptors = np.asarray(database.read_descriptors(image.image_id).data, np.uint8)
    colors = np.zeros((len(keypoints), 3), np.uint8)  # the database has none
    camera = database.read_camera(image.camera_id)
    return View(image.image_id, camera, Features(keypoints, descriptors, colors))


def _among(matches: Uint32Array, inliers: Uint32Array) -> NDArray[np.bool_]:
    found = {(first, second) for first, second in inliers.tolist()}
    return np.array([tuple(match) in found for match in matches.tolist()], np.bool_)


def _verdict(candidate: CandidateVerdict) -> str:
    if candidate.num_verified is not None:
        return f"verified: {candidate.num_verified} of {candidate.num_matches} matches are inliers"
    return candidate.rejected or "not matched on all features"


def _photo(summary: RunSummary, name: str, output: Path) -> Outcome:
    photos = {photo.name: photo for photo in summary.photos}
    if name not in photos:
        near = difflib.get_close_matches(name, photos, n=3, cutoff=0.3)
        hint = f"; did you mean {', '.join(near)}?" if near else ""
        raise InputError(f"{output}: has no photo called {name}{hint}")
    return photos[name]


def _verdict_of(
    database: pycolmap.Database, ids: Mapping[str, int], name: str, candidate: CandidateOutcome
) -> CandidateVerdict:
    pair = ids[name], ids[candidate.name]
    num_verified = _num_inliers(database, *pair)
    return CandidateVerdict(
        name=candidate.name,
        cosine=candidate.cosine,
        inliers=candidate.inliers,
        num_verified=num_verified,
        num_matches=len(database.read_matches(*pair)) if num_verified is not None else None,
        rejected="" if candidate.rejected is None else str(candidate.rejected),
    )


def _num_inliers(database: pycolmap.Database, id1: int, id2: int) -> int | None:
    if id1 == id2 or not database.exists_two_view_geometry(id1, id2):
        return None
    return len(database.read_two_view_geometry(id1, id2).inlier_matches)


def _num_points(model: Path, image_id: int) -> int:
    return int(read_model(model).image(image_id).num_points3D)
