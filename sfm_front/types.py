"""What the stages hand each other."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pycolmap

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Uint8Array = NDArray[np.uint8]
Uint32Array = NDArray[np.uint32]

DESCRIPTOR_NORM = 512.0
"""Length of a RootSIFT descriptor as COLMAP stores it, but for what rounding takes."""


class SkipReason(Enum):
    """Why a file given as a photo is not used."""

    NOT_AN_IMAGE = "not an image"
    EMPTY_FILE = "empty file"
    TRUNCATED = "truncated"
    UNREADABLE = "unreadable"
    TOO_SMALL = "too small"
    NO_FEATURES = "no features"
    DUPLICATE = "duplicate"


@dataclass(frozen=True, slots=True)
class Skipped:
    """A file that is not used, and why."""

    name: str
    reason: SkipReason
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.reason.value}: {self.detail}" if self.detail else self.reason.value


@dataclass(frozen=True, slots=True)
class PhotoPath:
    """A photo's file, and its name: the path below the photo folder with forward slashes."""

    name: str
    path: Path


@dataclass(frozen=True, slots=True)
class NotYet:
    """In place of the next item of a stream that goes on, but has none at the moment.

    ``seconds``: how long nothing has come.
    """

    seconds: float


@dataclass(frozen=True, slots=True)
class GeoPosition:
    """A WGS84 position: latitude and longitude in degrees, altitude in metres if known.

    Standard deviations in metres, where whoever measured it says so: ``horizontal_sigma_m`` of
    east and of north each, ``vertical_sigma_m`` of the altitude.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None = None
    horizontal_sigma_m: float | None = None
    vertical_sigma_m: float | None = None

    @property
    def is_fix(self) -> bool:
        """False at latitude and longitude 0, which receivers without a fix write."""
        return self.latitude_deg != 0 or self.longitude_deg != 0


@dataclass(frozen=True, slots=True)
class GimbalAngles:
    """Where a drone's camera looked, in degrees, as DJI counts them: ``yaw_deg`` clockwise from
    north, ``pitch_deg`` 0 at the horizon and -90 straight down, ``roll_deg`` about the axis."""

    yaw_deg: float
    pitch_deg: float
    roll_deg: float


@dataclass(frozen=True, slots=True)
class Exif:
    """What the camera wrote about a photo; ``None`` or empty where it wrote nothing usable.

    ``orientation`` is EXIF's 1 to 8; pixels are kept as stored, as COLMAP does. ``position`` is as
    written, also where it can be none: ``photos.position_checks`` looks at all of them together.
    """

    make: str = ""
    model: str = ""
    focal_length_mm: float | None = None
    focal_length_35mm: float | None = None
    captured_at: datetime | None = None
    position: GeoPosition | None = None
    orientation: int = 1
    gimbal: GimbalAngles | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A photo in memory.

    ``name`` is the path below the photo folder with forward slashes, as COLMAP names images.
    ``pixels`` is (h, w, 3) uint8 RGB, reduced to the working size and not rotated by EXIF.
    ``width`` and ``height`` are those of the file; keypoints and cameras refer to them.
    ``digest`` identifies the file's bytes.
    """

    name: str
    path: Path
    pixels: Uint8Array
    width: int
    height: int
    digest: str
    exif: Exif = field(default_factory=Exif)


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """What is remembered of a photo's content, keypoint of largest scale first.

    ``keypoints`` (N, 4) float32: x, y, scale, orientation (radians), in pixels of the file, the
    top-left pixel centred at (0.5, 0.5) as in COLMAP. ``descriptors`` (N, 128) uint8: RootSIFT
    times 512, as COLMAP stores them. ``colors`` (N, 3) uint8 RGB under each keypoint.
    """

    keypoints: Float32Array
    descriptors: Uint8Array
    colors: Uint8Array

    def __len__(self) -> int:
        return len(self.keypoints)

    @property
    def num_bytes(self) -> int:
        """In memory, and nearly so on disk."""
        parts: tuple[NDArray[Any], ...] = (self.keypoints, self.descriptors, self.colors)
        return sum(part.nbytes for part in parts)

    def largest(self, count: int) -> Features:
        """Its first ``count`` features, without a copy."""
        return Features(self.keypoints[:count], self.descriptors[:count], self.colors[:count])


@dataclass(frozen=True, slots=True, eq=False)
class ExtractedPhoto:
    """A photo that is ready to be retrieved, matched and mapped; its pixels are gone."""

    name: str
    path: Path
    width: int
    height: int
    digest: str
    exif: Exif
    features: Features
    global_vector: Float32Array
    seconds: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One side of a pair: a photo's image id, its camera and its features."""

    image_id: int
    camera: pycolmap.Camera
    features: Features

    def points(self, indices: NDArray[Any]) -> Float64Array:
        """(K, 2) pixels of the keypoints with these indices."""
        return self.features.keypoints[indices, :2].astype(np.float64)


@dataclass(frozen=True, slots=True)
class Candidate:
    """A photo that may overlap the query; ``cosine`` of the global vectors in [-1, 1]."""

    image_id: int
    cosine: float

    @property
    def inliers(self) -> None:
        """Not known before re-ranking."""
        return None


@dataclass(frozen=True, slots=True)
class RankedCandidate:
    """A re-ranked candidate.

    ``inliers``: SIFT matches that survived RANSAC, ``matches`` (inliers, 2): their keypoint indices
    in the query and in the candidate; ``rotation_rad``: in-plane rotation from the query to the
    candidate, None if the matches do not tell.
    """

    image_id: int
    cosine: float
    inliers: int
    rotation_rad: float | None
    matches: Uint32Array = field(repr=False, compare=False)


class WaitingReason(Enum):
    """Why a photo is in no model."""

    NO_MATCHES = "no verified matches with any photo"
    NEIGHBORS_WAIT = "verified matches only with photos that are not registered"
    NO_POSE = "no pose fits the model points it sees"


@dataclass(frozen=True, slots=True)
class Waiting:
    """A photo is in no model, and why; ``num_seen``: how many points of a model it sees, where no
    pose fits them."""

    reason: WaitingReason
    num_seen: int | None = None

    def __str__(self) -> str:
        if self.num_seen is None:
            return self.reason.value
        if not self.num_seen:
            return "it sees no point of a model"
        return f"no pose fits the {self.num_seen} model points it sees"


class Rejection(Enum):
    """Why two photos have no two-view geometry."""

    TOO_FEW_MATCHES = "too few tentative matches"
    NO_EPIPOLAR_GEOMETRY = "no epipolar geometry"
    TOO_FEW_INLIERS = "too few inliers"
    WATERMARK = "watermark"
    UNLIKELY = "too few inliers among the largest features"


@dataclass(frozen=True, slots=True)
class Rejected:
    """Why a pair has no two-view geometry.

    ``num_matches``: tentative matches, None if the photos were not matched on all features;
    ``num_inliers``: those that survived the step that rejected the pair.
    """

    reason: Rejection
    num_matches: int | None
    num_inliers: int

    def __str__(self) -> str:
        of = "" if self.num_matches is None else f" of {self.num_matches} matches"
        return f"{self.reason.value} ({self.num_inliers}{of})"


@dataclass(frozen=True, slots=True, eq=False)
class PairGeometry:
    """Verified overlap of two photos.

    ``matches`` (M, 2) uint32: tentative matches, keypoint indices in photo 1 and photo 2.
    ``two_view_geometry`` holds the inliers among them and cam2_from_cam1.
    """

    image_id1: int
    image_id2: int
    matches: Uint32Array
    two_view_geometry: pycolmap.TwoViewGeometry

    @property
    def num_inliers(self) -> int:
        return len(self.two_view_geometry.inlier_matches)


@dataclass(frozen=True, slots=True)
class CandidateOutcome:
    """What became of a candidate, by the photo's ``name``.

    ``inliers`` of re-ranking, None if it was not looked at; ``rejected``: why it has no verified
    pair, None if it has one or was not matched.
    """

    name: str
    cosine: float
    inliers: int | None
    verified: bool
    rejected: Rejected | None


@dataclass(frozen=True, slots=True)
class FileState:
    """A file, and by what a change of it is noticed; ``size`` in bytes, both None if it is gone."""

    path: Path
    size: int | None
    mtime_ns: int | None

    @classmethod
    def of(cls, path: Path) -> FileState:
        """Its state now."""
        try:
            status = path.stat()
        except OSError:
            return cls(path, None, None)
        return cls(path, status.st_size, status.st_mtime_ns)


@dataclass(frozen=True, slots=True, eq=False)
class StoredPhoto:
    """A photo that a session has stored, without its features: see ``ExtractedPhoto``."""

    image_id: int
    name: str
    camera_id: int
    file: FileState
    width: int
    height: int
    digest: str
    exif: Exif
    global_vector: Float32Array
    num_keypoints: int
    candidates: tuple[CandidateOutcome, ...]
    seconds: dict[str, float]

    @property
    def path(self) -> Path:
        """Where the file was."""
        return self.file.path


@dataclass(frozen=True, slots=True, eq=False)
class ModelSummary:
    """A finished model and the folder it was written to."""

    path: Path
    reconstruction: pycolmap.Reconstruction
    num_registered: int
    num_points: int
    mean_reprojection_error_px: float
    mean_track_length: float

    @classmethod
    def of(cls, reconstruction: pycolmap.Reconstruction, path: Path) -> ModelSummary:
        """Of a model as it is now."""
        return cls(
            path=path,
            reconstruction=reconstruction,
            num_registered=int(reconstruction.num_reg_images()),
            num_points=int(reconstruction.num_points3D()),
            mean_reprojection_error_px=float(reconstruction.compute_mean_reprojection_error()),
            mean_track_length=float(reconstruction.compute_mean_track_length()),
        )

    @property
    def path_in_output(self) -> str:
        """Such as ``sparse/0``."""
        return f"{self.path.parent.name}/{self.path.name}"
