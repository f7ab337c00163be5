"""How a model is grown: pycolmap's options, and ours."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace

import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions
from sfm_front.mapping.calibration import CalibrationOptions
from sfm_front.mapping.local_refinement import LocalRefinementOptions
from sfm_front.mapping.position_priors import PriorOptions
from sfm_front.mapping.refinement_schedule import ScheduleOptions
from sfm_front.mapping.thinned_adjustment import HUGE

# Trials are limited here, by the points a photo sees, not by pycolmap.
_UNLIMITED_TRIALS = 1_000_000


@dataclass(frozen=True, kw_only=True)
class InitialPairConstraints:
    """What two photos must satisfy to start a model: see COLMAP's ``init_*`` options."""

    min_angle_deg: float
    min_inliers: int
    max_forward_motion: float = 0.95
    # A new model with fewer 3-D points is rejected.
    min_points: int = 50
    # Refine focal length and distortion on the pair; few points do not determine them.
    refine_intrinsics: bool = True

    def __post_init__(self) -> None:
        if self.min_points < 1:
            raise ConfigError(f"min_points must be at least 1, got {self.min_points}")

    def applied_to(
        self, options: pycolmap.IncrementalMapperOptions
    ) -> pycolmap.IncrementalMapperOptions:
        """A copy of the options that asks this of an initial pair."""
        constrained = copy.deepcopy(options)
        constrained.init_min_tri_angle = self.min_angle_deg
        constrained.init_min_num_inliers = self.min_inliers
        constrained.init_max_forward_motion = self.max_forward_motion
        # A model that starts with few points cannot require more of the photos that follow.
        constrained.abs_pose_min_num_inliers = min(
            options.abs_pose_min_num_inliers, self.min_points
        )
        return constrained


@dataclass(frozen=True, kw_only=True)
class ConvergenceOptions:
    """When COLMAP's bundle adjustments stop: tolerances are relative changes of the cost.

    While photos arrive, each adjustment starts close to its optimum and another one follows, so it
    may stop early (TUNING: streaming-adjustment).
    """

    # Local adjustments while photos arrive.
    local_tolerance: float = 1e-4
    local_iterations: int = 12
    # Global ones while photos arrive, and how often each alternates with filtering at most.
    global_tolerance: float = 1e-4
    global_iterations: int = 15
    global_refinements: int = 2
    # Global ones of a complete model, and of a large one. COLMAP's own tolerance is 0. With 1e-5 a
    # long flight stays bent (TUNING: final-tolerance), with 1e-6 more or less so, by the order of
    # its photos (TUNING: large-tolerances).
    final_tolerance: float = 1e-5
    large_final_tolerance: float = 1e-7
    # That from which the robust adjustment of a model that is not large goes on, at the end.
    last_tolerance: float = 3e-5
    # Share of the observations from which that refinement goes on to another round.
    last_change: float = 5e-3

    def __post_init__(self) -> None:
        for name in vars(self):
            least = 0 if name.endswith(("tolerance", "change")) else 1
            if getattr(self, name) < least:
                raise ConfigError(f"{name} must be at least {least}, got {getattr(self, name)}")


@dataclass(frozen=True, kw_only=True)
class MapperOptions:
    """How a model is grown. Everything else is COLMAP's default."""

    # A photo that failed is retried once it sees this many times the points.
    retry_growth: float = 1.2
    # Refine focal length and distortion.
    refine_intrinsics: bool = True
    # A global adjustment moves the cameras by those points alone that add this much to what others
    # cover of a photo, and the others afterwards (TUNING: coverage-gain).
    min_coverage_gain: float = 0.1
    # The same of a model from that many photos on: fewer points place them as well, and memory and
    # time go with the points (TUNING: thinned).
    huge_coverage_gain: float = 0.5
    huge_from: int = HUGE
    # Of the bundle adjustment.
    num_threads: int = 2
    # Of all RANSAC.
    seed: int = 0
    schedule: ScheduleOptions = field(default_factory=ScheduleOptions)
    convergence: ConvergenceOptions = field(default_factory=ConvergenceOptions)
    local_refinement: LocalRefinementOptions = field(default_factory=LocalRefinementOptions)
    # The last adjustment; it takes threads, intrinsics and what counts as large from here.
    robust: RobustAdjustmentOptions = field(default_factory=RobustAdjustmentOptions)
    calibration: CalibrationOptions = field(default_factory=CalibrationOptions)
    # How far measured positions of the photos count.
    priors: PriorOptions = field(default_factory=PriorOptions)

    def __post_init__(self) -> None:
        if self.retry_growth < 1:
            raise ConfigError(f"retry_growth must be at least 1, got {self.retry_growth}")
        for name in ("min_coverage_gain", "huge_coverage_gain", "huge_from"):
            if getattr(self, name) < 0:
                raise ConfigError(f"{name} must not be negative, got {getattr(self, name)}")
        if self.num_threads < 1:
            raise ConfigError(f"num_threads must be at least 1, got {self.num_threads}")
        robust = replace(
            self.robust,
            refine_intrinsics=self.refine_intrinsics,
            num_threads=self.num_threads,
            large_from=self.schedule.large_from,
        )
        object.__setattr__(self, "robust", robust)

    def coverage_gain(self, num_photos: int) -> float:
        """What a point must add to move the cameras of a model of so many photos."""
        return self.huge_coverage_gain if num_photos >= self.huge_from else self.min_coverage_gain

    def final(self, num_photos: int) -> pycolmap.IncrementalPipelineOptions:
        """pycolmap's options for a complete model of ``num_photos``."""
        options = pycolmap.IncrementalPipelineOptions()
        large = num_photos >= self.schedule.large_from
        options.ba_global_function_tolerance = (
            self.convergence.large_final_tolerance if large else self.convergence.final_tolerance
        )
        options.num_threads = self.num_threads
        options.random_seed = self.seed
        options.ba_refine_focal_length = self.refine_intrinsics
        options.ba_refine_extra_params = self.refine_intrinsics
        options.mapper.max_reg_trials = _UNLIMITED_TRIALS
        options.mapper.ba_global_ignore_redundant_points3D = True
        options.mapper.ba_global_prune_points_min_coverage_gain = self.coverage_gain(num_photos)
        options.mapper.abs_pose_refine_focal_length = self.refine_intrinsics
        options.mapper.abs_pose_refine_extra_params = self.refine_intrinsics
        return options

    def last(self, num_photos: int) -> pycolmap.IncrementalPipelineOptions:
        """The same before the robust adjustment at the end: it need not converge
        (TUNING: last-refinement)."""
        options = self.final(num_photos)
        options.ba_global_max_refinement_change = self.convergence.last_change
        if num_photos < self.schedule.large_from:
            options.ba_global_function_tolerance = self.convergence.last_tolerance
        return options

    def streaming(self) -> pycolmap.IncrementalPipelineOptions:
        """The same while photos arrive, with bundle adjustments that stop early."""
        options = self.final(0)
        options.ba_local_function_tolerance = self.convergence.local_tolerance
        options.ba_local_max_num_iterations = self.convergence.local_iterations
        options.ba_global_function_tolerance = self.convergence.global_tolerance
        options.ba_global_max_num_iterations = self.convergence.global_iterations
        options.ba_global_max_refinements = self.convergence.global_refinements
        return options
