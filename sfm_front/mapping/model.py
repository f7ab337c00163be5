"""One model: initialise, register, triangulate, refine, filter."""

from __future__ import annotations

import copy
import time
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import pycolmap

from sfm_front.events import Emit, ModelRefined
from sfm_front.mapping.background_refinement import BackgroundAdjuster
from sfm_front.mapping.bundle_adjustment import (
    RobustAdjustmentOptions,
    robust_adjustment,
    solved_directly,
)
from sfm_front.mapping.calibration import is_miscalibrated
from sfm_front.mapping.camera_motion import camera_centers, camera_motion
from sfm_front.mapping.carry_over import carry_over
from sfm_front.mapping.final_adjustment import drop_misfits
from sfm_front.mapping.finished_model import finished_model
from sfm_front.mapping.held_camera import HeldCamera
from sfm_front.mapping.local_refinement import LocalRefinement
from sfm_front.mapping.mapper_options import InitialPairConstraints, MapperOptions
from sfm_front.mapping.model_state import ModelState
from sfm_front.mapping.next_image import NextImage
from sfm_front.mapping.position_priors import PositionPriors
from sfm_front.mapping.refinement_beside import RefinementBeside
from sfm_front.mapping.refinement_schedule import RefinementSchedule
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import Float64Array


class Model:
    """A model that grows photo by photo over a shared view graph."""

    def __init__(
        self,
        view_graph: ViewGraph,
        options: MapperOptions,
        *,
        emit: Emit | None = None,
        adjuster: BackgroundAdjuster | None = None,
        reconstruction: pycolmap.Reconstruction | None = None,
    ) -> None:
        """``emit`` hears of each refinement of the whole model. With an ``adjuster``, those that
        fall due while it grows happen in the background. It goes on from the ``reconstruction``
        if one is given."""
        # 0 until whoever starts it gives it another.
        self.model_id = 0
        self.is_georeferenced = False
        # Once it is finished, see ``FinishedModel``.
        self.focal_sigmas: Mapping[int, float] = {}
        self.is_held_to_positions: bool | None = None
        self._priors: PositionPriors | None = None
        self._finished: pycolmap.ObservationManager | None = None
        self._view_graph = view_graph
        self._options = options
        self.emit = emit
        self._beside = RefinementBeside(adjuster)
        self._streaming = options.streaming()
        self._mapping = self._streaming.get_mapper()
        self._triangulation = self._streaming.get_triangulation()
        self._local = LocalRefinement(self._streaming, options.local_refinement, view_graph.part)
        self._schedule = RefinementSchedule(options.schedule)
        self._next = NextImage(options.retry_growth)
        # Where no adjustment moves it, nothing is to be held.
        self._camera = HeldCamera(options.calibration, is_determined=not options.refine_intrinsics)
        self._mapper, self.reconstruction = view_graph.new_mapper(reconstruction)

    @classmethod
    def restored(
        cls,
        view_graph: ViewGraph,
        options: MapperOptions,
        reconstruction: pycolmap.Reconstruction,
        state: ModelState,
        emit: Emit | None = None,
        adjuster: BackgroundAdjuster | None = None,
    ) -> Model:
        """The model that had this ``state``, over a view graph that holds all its photos."""
        refine = options.refine_intrinsics and state.refine_intrinsics
        options = replace(options, refine_intrinsics=refine)
        model = cls(
            view_graph, options, emit=emit, adjuster=adjuster, reconstruction=reconstruction
        )
        model.model_id = state.model_id
        model.is_georeferenced = state.is_georeferenced
        model._mapping = copy.deepcopy(model._mapping)
        model._mapping.abs_pose_min_num_inliers = state.min_pose_inliers
        model._schedule.refined(state.refined_images, state.refined_points)
        model._camera.is_determined = state.is_camera_determined
        model._hold_camera()
        return model

    @property
    def state(self) -> ModelState:
        """What ``restored`` needs."""
        refined_images, refined_points = self._schedule.last
        return ModelState(
            model_id=self.model_id,
            refined_images=refined_images,
            refined_points=refined_points,
            min_pose_inliers=self._mapping.abs_pose_min_num_inliers,
            refine_intrinsics=self._options.refine_intrinsics,
            is_georeferenced=self.is_georeferenced,
            is_camera_determined=self._camera.is_determined,
        )

    def succeeded_by(self, reconstruction: pycolmap.Reconstruction) -> Model:
        """The same model with another reconstruction over its view graph.

        It tells nobody of its refinements until it is given ``emit``.
        """
        return Model.restored(
            self._view_graph,
            self._options,
            reconstruction,
            self.state,
            adjuster=self._beside.adjuster,
        )

    @property
    def registered(self) -> set[int]:
        """Image ids. Frames carry the ids of their only image."""
        return set(self.reconstruction.reg_image_ids())

    @property
    def num_registered(self) -> int:
        return int(self.reconstruction.num_reg_images())

    @property
    def num_points(self) -> int:
        return int(self.reconstruction.num_points3D())

    def num_visible_points(self, image_id: int) -> int:
        """Points of the model that a photo's verified matches lead to."""
        observations = self._finished or self._mapper.observation_manager
        return int(observations.num_visible_points3D(image_id))

    def extend(self, image_id: int) -> None:
        """Make a photo just added to the view graph known to the model."""
        self._view_graph.extend(self._mapper, self.reconstruction, image_id)

    def take_pairs(self, image_ids: Iterable[int]) -> None:
        """Triangulate what pairs show that were added to the view graph after their photos.

        ``image_ids``: the photos of these pairs. The model is not refined.
        """
        self._triangulate_anew(self.registered.intersection(image_ids))

    def take_two_view_tracks(self) -> None:
        """Triangulate points that two photos alone show, too, from now on.

        COLMAP leaves them out: nothing checks them. Where photos stand far apart there are hardly
        any others to register a further one by.
        """
        self._triangulation.ignore_two_view_tracks = False
        self._triangulate_anew(self.registered)

    def _triangulate_anew(self, image_ids: Iterable[int]) -> None:
        self._begin_anew()
        for image_id in sorted(image_ids):
            self._mapper.triangulate_image(self._triangulation, image_id)
        self.forget_failures()

    def initialize(
        self, image_id1: int, image_id2: int, constraints: InitialPairConstraints
    ) -> bool:
        """Start from a pair. False if it yields no model; discard this object then."""
        self._mapping = constraints.applied_to(self._mapping)
        cam2_from_cam1 = self._mapper.estimate_initial_two_view_geometry(
            self._mapping, image_id1, image_id2
        )
        if cam2_from_cam1 is None:
            return False
        self._mapper.register_initial_image_pair(
            self._mapping, image_id1, image_id2, cam2_from_cam1
        )
        for image_id in (image_id1, image_id2):
            self._mapper.triangulate_image(self._triangulation, image_id)
        if self.num_points < constraints.min_points:
            return False
        self._hold_camera()
        adjustment = self._options.final(2).get_global_bundle_adjustment()
        adjustment.refine_focal_length &= constraints.refine_intrinsics
        adjustment.refine_extra_params &= constraints.refine_intrinsics
        self._mapper.adjust_global_bundle(self._mapping, adjustment)
        self.reconstruction.normalize()
        self._mapper.filter_points(self._mapping)
        if self.num_points < constraints.min_points:
            return False
        self._note_refined()
        return True

    def grow(self, photos: Iterable[int], at_most: int | None = None) -> list[int]:
        """Register all of these that see enough of the model, the best one first, or the best few.

        Registered ones are skipped. Returns the image ids in order of registration.
        """
        self._take_refined()
        placed: list[int] = []
        left = set(photos) - self.registered
        while len(placed) != at_most and (image_id := self._best(left)) is not None:
            left.discard(image_id)
            if self._register(image_id):
                placed.append(image_id)
                self._local.add(self._mapper, image_id)
                if self._schedule.is_due(self.num_registered, self.num_points):
                    self._refine_while_growing()
        return placed

    def register_structure_less(self, photos: Iterable[int]) -> list[int]:
        """Register photos that see no 3-D points by their matches to registered photos.

        Registered ones are skipped, as in ``grow``.
        """
        placed: list[int] = []
        for image_id in sorted(set(photos) - self.registered):
            if not self._view_graph.neighbors(image_id).keys() & self.registered:
                continue
            if self._mapper.register_next_structure_less_image(self._mapping, image_id):
                self._mapper.triangulate_image(self._triangulation, image_id)
                self._local.add(self._mapper, image_id)
                placed.append(image_id)
        return placed

    def find_initial_pair(self, constraints: InitialPairConstraints) -> tuple[int, int] | None:
        """The best pair of the view graph by COLMAP's search; each call gives another, or None."""
        options = constraints.applied_to(self._mapping)
        found = self._mapper.find_initial_image_pair(options, -1, -1)
        return None if found is None else found[0]

    def refine(self) -> None:
        """Bundle-adjust the whole model, complete and merge tracks, drop what does not fit."""
        self._refine(self._options.final(self.num_registered))

    def refine_briefly(self) -> None:
        """The same as far as a model needs it that goes on growing."""
        self._refine(self._streaming)

    def settle(self) -> bool:
        """Refine the whole model unless that has been done since its last photo came.

        False while it happens in the background: ask again.
        """
        self._take_refined()
        if not self.is_under_way and not self._is_settled:
            self._refine_while_growing()
        return self._is_settled

    @property
    def _is_settled(self) -> bool:
        return not self.is_under_way and self._schedule.last[0] == self.num_registered

    @property
    def is_under_way(self) -> bool:
        """Whether it is being refined in the background."""
        return self._beside.is_under_way

    def leave_refinement(self) -> None:
        """What is refined in the background is not waited for: all of it will be done at once."""
        self._beside.leave()

    def georeference(self, enu_from_world: pycolmap.Sim3d, priors: PositionPriors) -> None:
        """Move the world to the frame of these positions, to which it is held from now on.

        Not while it is being refined in the background: that would come back in the old frame.
        """
        assert not self.is_under_way
        self.reconstruction.transform(enu_from_world)
        self.is_georeferenced = True
        self._priors = priors

    def only(self, image_ids: Collection[int]) -> Model:
        """A model of these of its photos, over the view graph as it is now."""
        reconstruction = copy.deepcopy(self.reconstruction)
        for image_id in sorted(self.registered - set(image_ids)):
            reconstruction.deregister_frame(reconstruction.image(image_id).frame_id)
        part = self.succeeded_by(reconstruction)
        part.emit = self.emit
        return part

    def finish(self) -> None:
        """Refine a last time. The model cannot grow any more after this."""
        self._refine(self._options.last(self.num_registered))
        # On fewer points first: most of the way is done in a fraction of the time.
        self._mapper.adjust_global_bundle(
            self._mapping, robust_adjustment(self._options.robust, self.num_registered)
        )
        self.reconstruction.update_point_3d_errors()
        finished = finished_model(self.reconstruction, self._options, self._mapping, self._priors)
        self.focal_sigmas = finished.focal_sigmas
        self.is_held_to_positions = finished.is_held_to_positions
        self._end_as(finished.reconstruction)

    def _end_as(self, reconstruction: pycolmap.Reconstruction) -> None:
        """What is asked from here on must be of the model that is handed out."""
        self.reconstruction = reconstruction
        self._finished = self._view_graph.observations_of(reconstruction)

    @property
    def robust(self) -> RobustAdjustmentOptions:
        """How it is adjusted at its end."""
        return self._options.robust

    def adopt(self, adjusted: pycolmap.Reconstruction) -> None:
        """Become this adjusted copy of it, without the points that do not fit any more; once it is
        finished."""
        drop_misfits(adjusted)
        self._end_as(adjusted)

    @property
    def is_miscalibrated(self) -> bool:
        """Whether most photos have implausible intrinsics: they do not determine them."""
        return is_miscalibrated(self.reconstruction, self._mapping)

    def forget_failures(self) -> None:
        """Allow every waiting photo to be retried."""
        self._next.forget_failures()

    def _best(self, waiting: Iterable[int]) -> int | None:
        min_visible = self._mapping.abs_pose_min_num_inliers
        return self._next.best(self._mapper.observation_manager, waiting, min_visible)

    def _register(self, image_id: int) -> bool:
        num_visible = self.num_visible_points(image_id)
        if self._mapper.register_next_image(self._mapping, image_id):
            self._mapper.triangulate_image(self._triangulation, image_id)
            return True
        self._next.failed(image_id, num_visible)
        return False

    def _refine_while_growing(self) -> None:
        if not self._beside.serves(self.reconstruction):
            self._refine(self._streaming)
        elif self._beside.is_free:  # else it stays due
            self._begin_anew()
            self._mapper.complete_and_merge_tracks(self._triangulation)
            refine = self._options.refine_intrinsics and not self._camera.ids
            options = replace(self._options, refine_intrinsics=refine)
            self._beside.begin(self.reconstruction, options)
            self._note_refined()

    def _take_refined(self) -> None:
        """Carry over what refinement in the background has changed, if it has ended."""
        refined = self._beside.ended()
        if refined is None:
            return
        started, centers = time.perf_counter(), camera_centers(self.reconstruction)
        neighbors = {
            i: self._view_graph.strongest_neighbors(i)
            for i in self.registered - refined.before.poses.keys()
        }
        carry_over(self.reconstruction, refined.before, refined.copy, neighbors)
        self._begin_anew()
        self._mapper.complete_and_merge_tracks(self._triangulation)
        self._mapper.filter_points(self._mapping)
        self._announce_refined(time.perf_counter() - started, centers)

    def _begin_anew(self) -> None:
        """pycolmap does not count a later photo's correspondences to registered ones; taking a
        photo out would then fail. Beginning again over the same model counts afresh."""
        self._mapper.end_reconstruction(False)
        self._mapper.begin_reconstruction(self.reconstruction)

    def _refine(self, pipeline: pycolmap.IncrementalPipelineOptions) -> None:
        self._beside.leave()
        started, centers = time.perf_counter(), camera_centers(self.reconstruction)
        self._begin_anew()
        gain = self._options.coverage_gain(self.num_registered)
        self._mapping.ba_global_prune_points_min_coverage_gain = gain
        self._mapper.iterative_global_refinement(
            pipeline.ba_global_max_refinements,
            pipeline.ba_global_max_refinement_change,
            self._mapping,
            solved_directly(pipeline.get_global_bundle_adjustment()),
            self._triangulation,
            normalize_reconstruction=not self.is_georeferenced,
        )
        seconds = time.perf_counter() - started
        self._note_refined()
        self._announce_refined(seconds, centers)

    def _announce_refined(self, seconds: float, centers: Mapping[int, Float64Array]) -> None:
        """``centers``: where its photos stood before."""
        self._hold_camera(was_adjusted=True)
        self._local.forget(self._mapper)
        if self.emit is not None:
            self.emit(
                ModelRefined(
                    self.model_id,
                    self.num_registered,
                    self.num_points,
                    seconds,
                    *camera_motion(centers, camera_centers(self.reconstruction)),
                )
            )

    def _hold_camera(self, *, was_adjusted: bool = False) -> None:
        """Unless its photos determine it, as an adjustment may have shown."""
        decide = self._camera.look_at if was_adjusted else self._camera.hold
        decide(self.reconstruction, self._view_graph.cameras)
        self._mapping.constant_cameras = self._camera.ids
        self._local.held_cameras = self._camera.ids

    def _note_refined(self) -> None:
        self._schedule.refined(self.num_registered, self.num_points)
