"""What became of the cameras: their lenses, how far they drifted, and whether that is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sfm_front.types import ModelSummary

if TYPE_CHECKING:
    import pycolmap

# Share of the focal length by which EXIF is seldom wrong, but for cropped photos.
_DOUBTFUL_DRIFT = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraOutcome:
    """A camera of a finished model; ``model_path`` is relative to the output.

    ``lens``: COLMAP's camera model, with ``params`` in its order and in pixels of the files.
    ``prior_focal_px``: the focal length by EXIF or a calibration that was given; None without.
    ``focal_sigma``: standard deviation of the focal length by the photos alone, as a share of it,
    and ``is_determined``: whether that is small; None if the photos are too few to tell.
    """

    model_path: str
    camera_id: int
    num_photos: int
    lens: str
    params: tuple[float, ...]
    focal_px: float
    prior_focal_px: float | None
    focal_sigma: float | None
    is_determined: bool | None

    @property
    def drift(self) -> float | None:
        """How much longer the focal length is than it was said to be, as a share of that."""
        if self.prior_focal_px is None:
            return None
        return self.focal_px / self.prior_focal_px - 1


def camera_outcomes(
    model: ModelSummary,
    first_cameras: Mapping[int, pycolmap.Camera],
    focal_sigmas: Mapping[int, float],
    max_focal_sigma: float,
) -> list[CameraOutcome]:
    """Of a model. ``first_cameras``: as photos came with them, by id; ``focal_sigmas``: of
    those that have photos enough; up to ``max_focal_sigma`` they are determined."""
    reconstruction = model.reconstruction
    photos = Counter(reconstruction.image(i).camera_id for i in reconstruction.reg_image_ids())
    outcomes = []
    for camera_id, num_photos in sorted(photos.items()):
        camera, first = reconstruction.camera(camera_id), first_cameras[camera_id]
        sigma = focal_sigmas.get(camera_id)
        outcomes.append(
            CameraOutcome(
                model_path=model.path_in_output,
                camera_id=camera_id,
                num_photos=num_photos,
                lens=camera.model_name,
                params=tuple(camera.params.tolist()),
                focal_px=float(camera.mean_focal_length()),
                prior_focal_px=(
                    float(first.mean_focal_length()) if first.has_prior_focal_length else None
                ),
                focal_sigma=sigma,
                is_determined=None if sigma is None else sigma <= max_focal_sigma,
            )
        )
    return outcomes


def camera_warnings(cameras: Sequence[CameraOutcome], model_path: str) -> list[str]:
    """A line for each camera of a model whose focal length is far from what EXIF says, the one with
    most photos first."""
    drifted = [
        camera
        for camera in cameras
        if camera.model_path == model_path
        and camera.drift is not None
        and abs(camera.drift) > _DOUBTFUL_DRIFT
    ]
    return [_warning(camera) for camera in sorted(drifted, key=lambda one: -one.num_photos)]


def _warning(camera: CameraOutcome) -> str:
    assert camera.drift is not None
    assert camera.prior_focal_px is not None
    line = (
        f"camera {camera.camera_id} ({camera.num_photos} photos): its focal length ended at "
        f"{camera.focal_px:.0f} px, {abs(camera.drift):.0%} "
        f"{'above' if camera.drift > 0 else 'below'} the {camera.prior_focal_px:.0f} px of EXIF"
    )
    if camera.is_determined:
        return f"{line}; the photos determine it"
    if camera.is_determined is None:
        return f"{line}; too few photos to tell which is right"
    return f"{line}, and the photos do not determine it: the model may be bent"


def camera_rows(cameras: Sequence[CameraOutcome]) -> list[dict[str, Any]]:
    """Ready for JSON."""
    return [
        {
            "model": camera.model_path,
            "camera_id": camera.camera_id,
            "photos": camera.num_photos,
            "lens": camera.lens,
            "params": camera.params,
            "focal_px": round(camera.focal_px, 3),
            "prior_focal_px": _rounded(camera.prior_focal_px, 3),
            "focal_drift": _rounded(camera.drift, 5),
            "focal_sigma": _rounded(camera.focal_sigma, 6),
            "determined": camera.is_determined,
        }
        for camera in cameras
    ]


def cameras_from_rows(rows: Sequence[Mapping[str, Any]]) -> tuple[CameraOutcome, ...]:
    """Of what ``camera_rows`` wrote."""
    return tuple(
        CameraOutcome(
            model_path=row["model"],
            camera_id=row["camera_id"],
            num_photos=row["photos"],
            lens=row["lens"],
            params=tuple(row["params"]),
            focal_px=row["focal_px"],
            prior_focal_px=row["prior_focal_px"],
            focal_sigma=row["focal_sigma"],
            is_determined=row["determined"],
        )
        for row in rows
    )


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
