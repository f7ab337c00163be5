"""Photos → the COLMAP cameras they share, with an initial focal length."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias, get_args

from sfm_front.errors import ConfigError
from sfm_front.photos.exif import FULL_FRAME_DIAGONAL_MM
from sfm_front.types import ExtractedPhoto, Photo, StoredPhoto

if TYPE_CHECKING:
    import pycolmap

CameraMode = Literal["auto", "single", "per-folder", "per-image"]
AnyPhoto: TypeAlias = "Photo | ExtractedPhoto | StoredPhoto"

AUTO = "auto"
"""Cameras start as ``SIMPLE_RADIAL``, and get a richer lens at the end where it is borne out."""

DEFAULT_FOCAL_FACTOR = 1.2
"""Focal length over the long side if EXIF gives none, as in COLMAP."""


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """How cameras are assigned to photos."""

    # Which photos share one camera.
    #   auto: those of the same make, model, focal length and size; those without EXIF by folder
    #   and size (see photos_per_size); the tops of folders that were added are one folder.
    #   single: all. per-folder: those of a folder. per-image: none.
    # In every mode photos of different size have different cameras: COLMAP would reject them in the
    # modes single and per-folder; here no photo is lost. Portrait and landscape differ in size.
    mode: CameraMode = "auto"
    # A COLMAP camera model, which stays; or auto: SIMPLE_RADIAL, which at the end becomes RADIAL or
    # OPENCV where the photos bear it out (mapping/lens_growth.py). With params, it stays as well.
    model: str = AUTO
    # Known calibration, in COLMAP's order and in pixels of the file. It applies to the first photo
    # and all of its size; photos of other sizes start from their own focal length.
    params: tuple[float, ...] | None = None
    # Photos without EXIF share cameras while their folder has at most one size, plus one per this
    # many photos. Film frames, phones and benchmarks have one size per folder; photos from the
    # internet have nearly as many sizes as photos, and equal ones by chance
    # (TUNING: photos-per-size).
    photos_per_size: int = 10
    # Smallest plausible focal length over the long side; an EXIF focal length below it is ignored.
    min_focal_factor: float = 0.1
    # The largest one; an EXIF focal length above it is ignored.
    max_focal_factor: float = 10.0

    def __post_init__(self) -> None:
        import pycolmap

        if self.mode not in get_args(CameraMode):
            modes = ", ".join(get_args(CameraMode))
            raise ConfigError(f"camera mode must be one of {modes}, got {self.mode}")
        models = [name for name in pycolmap.CameraModelId.__members__ if name != "INVALID"]
        if self.model not in (AUTO, *models):
            raise ConfigError(
                f"camera model must be {AUTO} or one of {', '.join(models)}, got {self.model}"
            )
        if self.photos_per_size < 1:
            raise ConfigError(f"photos_per_size must be at least 1, got {self.photos_per_size}")
        if not self.min_focal_factor > 0:
            raise ConfigError(f"min_focal_factor must be above 0, got {self.min_focal_factor}")
        if not self.max_focal_factor > self.min_focal_factor:
            raise ConfigError(
                f"max_focal_factor must be above min_focal_factor ({self.min_focal_factor}), "
                f"got {self.max_focal_factor}"
            )
        if self.params is None:
            return
        expected = pycolmap.Camera.create_from_model_name(1, self.first_model, 1.0, 1, 1)
        if len(self.params) != len(expected.params):
            raise ConfigError(
                f"camera params of {self.first_model} are {len(expected.params)} numbers "
                f"({expected.params_info}), got {len(self.params)}"
            )
        if not all(math.isfinite(value) for value in self.params):
            raise ConfigError(f"camera params must be finite numbers, got {self.params}")
        if any(self.params[i] <= 0 for i in expected.focal_length_idxs()):
            raise ConfigError(
                f"camera params of {self.first_model} ({expected.params_info}): "
                f"focal lengths must be above 0, got {self.params}"
            )

    @property
    def first_model(self) -> str:
        """The COLMAP camera model that cameras start with."""
        return "SIMPLE_RADIAL" if self.model == AUTO else self.model

    @property
    def may_grow(self) -> bool:
        """Whether a camera may end with a richer model."""
        return self.model == AUTO and self.params is None


def folder_of(name: str) -> str:
    """The folder that a photo's name says it is in."""
    return str(PurePosixPath(name).parent)


class CameraChoice(NamedTuple):
    """The camera of a photo; ``is_new`` if no earlier photo uses it."""

    camera_id: int
    camera: pycolmap.Camera
    is_new: bool


@dataclass(slots=True)
class _Folder:
    """Photos without EXIF in one folder: their number so far, and sizes as (short, long) side."""

    num_photos: int = 0
    sizes: set[tuple[int, int]] = field(default_factory=set)


class CameraCatalog:
    """Assigns cameras to photos that arrive one at a time.

    An assignment never changes: mapping already uses it. A resumed session calls ``remember`` for
    its earlier photos in order, and continues as if it had never stopped.
    """

    def __init__(
        self,
        options: CameraOptions | None = None,
        shared_folder: Callable[[str], str] = folder_of,
    ) -> None:
        """``shared_folder``: photos without EXIF may share a camera if it is the same for their
        names."""
        self._options = options or CameraOptions()
        self._shared_folder = shared_folder
        self._cameras: dict[Hashable, pycolmap.Camera] = {}
        self._folders: dict[str, _Folder] = {}
        self._calibrated_size: tuple[int, int] | None = None
        self._last_id = 0

    def camera_for(self, photo: AnyPhoto) -> CameraChoice:
        """The camera of a newly arrived photo. The object may be shared with earlier photos.

        Raises ConfigError if the given calibration does not fit the first photo.
        """
        key = self._arrive(photo)
        known = self._cameras.get(key)
        if known is not None:
            return CameraChoice(known.camera_id, known, is_new=False)
        camera = self._new_camera(photo)
        self._keep(key, camera)
        return CameraChoice(camera.camera_id, camera, is_new=True)

    def remember(self, photo: AnyPhoto, camera: pycolmap.Camera) -> None:
        """Restore an earlier session's choice for a photo; call in order of arrival."""
        self._keep(self._arrive(photo), camera)

    def _keep(self, key: Hashable, camera: pycolmap.Camera) -> None:
        self._cameras.setdefault(key, camera)
        self._last_id = max(self._last_id, camera.camera_id)

    def _arrive(self, photo: AnyPhoto) -> Hashable:
        """Count a photo in; equal keys share a camera."""
        size = photo.width, photo.height
        if self._calibrated_size is None:
            self._calibrated_size = size
        match self._options.mode:
            case "per-image":
                return ("photo", photo.name)
            case "single":
                return ("all", size)
            case "per-folder":
                return ("folder", folder_of(photo.name), size)
        exif = photo.exif
        identity = (exif.make, exif.model, exif.focal_length_mm, exif.focal_length_35mm)
        if any(identity):
            return ("camera", identity, size)
        folder = self._shared_folder(photo.name)
        seen = self._folders.setdefault(folder, _Folder())
        seen.num_photos += 1
        seen.sizes.add((min(size), max(size)))
        if len(seen.sizes) <= 1 + seen.num_photos // self._options.photos_per_size:
            return ("folder", folder, size)
        return ("photo", photo.name)

    def _new_camera(self, photo: AnyPhoto) -> pycolmap.Camera:
        import pycolmap

        prior = focal_prior_px(photo, self._options)
        camera = pycolmap.Camera.create_from_model_name(
            self._last_id + 1,
            self._options.first_model,
            prior or DEFAULT_FOCAL_FACTOR * max(photo.width, photo.height),
            photo.width,
            photo.height,
        )
        camera.has_prior_focal_length = prior is not None
        params = self._options.params
        if params is not None and (photo.width, photo.height) == self._calibrated_size:
            _check_principal_point(camera, params, photo)
            camera.params = list(params)
            camera.has_prior_focal_length = True
        return camera


def focal_prior_px(photo: AnyPhoto, options: CameraOptions) -> float | None:
    """The focal length in pixels according to EXIF; None if absent or implausible.

    From the 35 mm equivalent, by diagonals as in COLMAP; else from the focal length and the sensor
    width of this make and model in COLMAP's camera database, for which pycolmap reads the file.
    """
    exif = photo.exif
    focal_px: float | None = None
    if exif.focal_length_35mm is not None:
        diagonal_px = math.hypot(photo.width, photo.height)
        focal_px = exif.focal_length_35mm / FULL_FRAME_DIAGONAL_MM * diagonal_px
    elif exif.focal_length_mm is not None and exif.make and exif.model:
        focal_px = _focal_from_camera_database(photo)
    if focal_px is None:
        return None
    factor = focal_px / max(photo.width, photo.height)
    return focal_px if options.min_focal_factor <= factor <= options.max_focal_factor else None


def _focal_from_camera_database(photo: AnyPhoto) -> float | None:
    import pycolmap

    try:
        camera = pycolmap.infer_camera_from_image(photo.path)
    except ValueError:  # A format that pycolmap cannot read, such as WebP.
        return None
    return float(camera.mean_focal_length()) if camera.has_prior_focal_length else None


def _check_principal_point(
    camera: pycolmap.Camera, params: tuple[float, ...], photo: AnyPhoto
) -> None:
    point = [params[i] for i in camera.principal_point_idxs()]
    if not all(0 < at < side for at, side in zip(point, (photo.width, photo.height), strict=False)):
        raise ConfigError(
            f"camera params put the principal point at {tuple(point)}, outside {photo.name} "
            f"({photo.width} x {photo.height}). Give them in pixels of the files."
        )
