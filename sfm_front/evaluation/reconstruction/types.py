"""What the parts of the reconstruction benchmark exchange."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from sfm_front.errors import ConfigError

CAMERA_MODES = ("auto", "single", "per-folder", "per-image")


@dataclass(frozen=True, kw_only=True)
class BenchmarkSettings:
    """What all methods are given.

    ``max_image_size_px`` limits the long side, ``max_features`` the features per photo. ``order``
    and ``seed`` set how photos arrive, for a method that takes them one by one.
    """

    threads: int
    max_image_size_px: int = 1600
    max_features: int = 4000
    camera_mode: str = "auto"
    order: str = "name"
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("threads", "max_image_size_px", "max_features"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be at least 1, got {getattr(self, name)}")
        if self.camera_mode not in CAMERA_MODES:
            raise ConfigError(
                f"camera_mode must be one of {', '.join(CAMERA_MODES)}, got {self.camera_mode}"
            )


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run of a method on a scene.

    ``wall_seconds`` is the whole process; ``seconds_by_stage`` and ``photo_seconds`` (one per
    photo) are what it measured itself, and may overlap in time. ``models`` are folders, largest
    first. ``failure`` says why there is no model.
    """

    wall_seconds: float
    peak_memory_bytes: int | None
    seconds_by_stage: dict[str, float] = field(default_factory=dict)
    photo_seconds: tuple[float, ...] = ()
    models: tuple[Path, ...] = ()
    failure: str | None = None
