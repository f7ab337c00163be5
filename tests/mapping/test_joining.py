"""Two models that bridge photos show to be one, over scenes with known truth and true matches."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import SceneFeed, position_errors_m

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import ModelEvent, ModelsJoined
from sfm_front.geometry.similarity import Similarities
from sfm_front.mapping.acceptance import AcceptanceOptions
from sfm_front.mapping.atlas import Atlas, AtlasOptions
from sfm_front.mapping.background_refinement import BackgroundAdjuster
from sfm_front.mapping.bridging import BridgingOptions
from sfm_front.mapping.bundle_adjustment import adjust_all
from sfm_front.mapping.finishing import finish
from sfm_front.mapping.joining import JoiningOptions
from sfm_front.mapping.mapper_options import InitialPairConstraints, MapperOptions
from sfm_front.mapping.merging import merged, with_cameras_of
from sfm_front.mapping.model import Model
from sfm_front.mapping.similarity_estimation import SimilarityOptions
from sfm_front.types import PairGeometry

# Two flights of 12 photos each over hills, and four that see what both saw.
FIRST, BRIDGES, SECOND = range(12), range(12, 16), range(16, 28)
OPTIONS = AtlasOptions(mapper=MapperOptions(num_threads=1))
# The photos are taken from 100 m; 0.5 px of noise are 4 cm on the ground.
POSITION_TOLERANCE_M = 1.0
PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def flight() -> SyntheticScene:
    return make_scene(28, 500, seed=4)


def are_linked(index: int, other: int) -> bool:
    """Photos of the two flights have no pairs with each other."""
    return not ({index, other} & {*FIRST} and {index, other} & {*SECOND})


class Flights(SceneFeed):
    """Both flights, in turn; the photos of ``lying`` match keypoints of the second at random."""

    def __init__(
        self,
        scene: SyntheticScene,
        lying: Iterable[int] = (),
        adjuster: BackgroundAdjuster | None = None,
    ) -> None:
        super().__init__(scene, linked=are_linked)
        self._lying = set(lying)
        self.events: list[ModelEvent] = []
        self.atlas = Atlas(self.scene, OPTIONS, self.events.append, adjuster)
        for pair in zip(FIRST, SECOND, strict=True):
            for index in pair:
                self.atlas.add(self.add(index))

    @property
    def joins(self) -> list[ModelsJoined]:
        return [event for event in self.events if isinstance(event, ModelsJoined)]

    def pair(self, index: int, other: int, ids: tuple[int, int]) -> PairGeometry:
        true = super().pair(index, other, ids)
        if index not in self._lying or other not in SECOND:
            return true
        matches = true.matches.copy()
        np.random.default_rng(index).shuffle(matches[:, 1])
        true.two_view_geometry.inlier_matches = matches
        return replace(true, matches=matches)

    def add_waiting(self, indices: Iterable[int]) -> list[int]:
        """Add photos and place none; returns their image ids."""
        ids = []
        for index in indices:
            ids.append(self.add(index))
            for model in self.atlas.models:
                model.extend(ids[-1])
        return ids

    def poses(self) -> list[dict[int, np.ndarray]]:
        """(3, 4) of each photo of each model."""
        models = [model.reconstruction for model in self.atlas.models]
        return [
            {i: model.image(i).cam_from_world().matrix() for i in model.reg_image_ids()}
            for model in models
        ]


def bend_second(atlas: Atlas) -> pycolmap.Reconstruction:
    """Give the smaller model another focal length, and what is true to it."""
    model = atlas.models[1].reconstruction
    model.camera(1).params = (model.camera(1).params * (1.05, 1.0, 1.0, 1.0)).tolist()
    held = pycolmap.BundleAdjustmentOptions(print_summary=False)
    held.refine_focal_length = held.refine_extra_params = False
    adjust_all(model, held)
    return model


def assert_whole(atlas: Atlas, scene: SyntheticScene) -> None:
    assert [model.num_registered for model in atlas.models] == [len(scene)]
    finish(atlas)
    errors = position_errors_m(atlas.models[0].reconstruction, scene)
    assert errors.max() < POSITION_TOLERANCE_M


def test_one_photo_that_both_models_see_joins_them(flight):
    flights = Flights(flight)
    assert [model.num_registered for model in flights.atlas.models] == [12, 12]
    first, second = flights.atlas.models
    bridge = flights.add(12)
    # Nothing else was in no model before.
    assert flights.atlas.add(bridge) == [bridge]
    (join,) = flights.joins
    assert (join.model_id, join.joined_model_id) == (first.model_id, second.model_id)
    assert join.num_registered == (12, 12)
    assert join.bridges == (bridge,)
    assert join.num_matches >= OPTIONS.joining.bridging.min_matches
    assert str(join).startswith("model 2 of 12 photos joined to model 1 of 12: ")
    assert flights.atlas.models[0].model_id == first.model_id
    for index in BRIDGES[1:]:
        flights.atlas.add(flights.add(index))
    assert_whole(flights.atlas, flight)


def test_photos_placed_in_both_models_join_them(flight):
    """As when a join was refused, and the larger model took photos of the smaller one."""
    flights = Flights(flight)
    ids = flights.add_waiting(BRIDGES)
    for model in flights.atlas.models:
        assert set(model.grow(ids)) == set(ids)
    flights.atlas.grow()
    assert set(flights.joins[0].bridges) <= set(ids)
    assert_whole(flights.atlas, flight)


def test_models_with_different_intrinsics_are_joined(flight):
    flights = Flights(flight)
    bend_second(flights.atlas)
    for index in BRIDGES:
        flights.atlas.add(flights.add(index))
    assert len(flights.joins) == 1
    assert_whole(flights.atlas, flight)


def test_intrinsics_of_another_model_are_taken_over_by_adjusting_to_them(flight):
    flights = Flights(flight)
    bent, larger = bend_second(flights.atlas), flights.atlas.models[0].reconstruction
    params = bent.camera(1).params.copy()
    adjusted = with_cameras_of(bent, larger, OPTIONS.mapper)
    np.testing.assert_array_equal(adjusted.camera(1).params, larger.camera(1).params)
    np.testing.assert_array_equal(bent.camera(1).params, params)
    adjusted.update_point_3d_errors()
    assert adjusted.compute_mean_reprojection_error() < 1.0
    assert with_cameras_of(adjusted, larger, OPTIONS.mapper) is adjusted


def test_matches_that_agree_on_no_similarity_join_nothing(flight):
    flights = Flights(flight, lying=BRIDGES)
    flights.add_waiting(BRIDGES)
    before, models = flights.poses(), flights.atlas.models
    assert flights.atlas._joiner.join(models) == models
    assert flights.joins == []
    np.testing.assert_equal(flights.poses(), before)


def test_a_bridge_is_not_believed_where_another_contradicts(flight):
    flights = Flights(flight, lying=[13])
    models = flights.atlas.models
    true, _ = flights.add_waiting(BRIDGES[:2])
    assert flights.atlas._joiner.join(models) == models
    # With two more that say the same as the first it is.
    also_true = flights.add_waiting(BRIDGES[2:])
    flights.atlas.grow()
    (join,) = flights.joins
    assert {true, *also_true} <= set(join.bridges)
    assert [model.num_registered for model in flights.atlas.models] == [len(flight)]


def test_a_join_that_ruins_the_models_is_undone(flight, monkeypatch):
    """As if the similarity had been a wrong one that all bridges agree on."""
    flights = Flights(flight)
    astray = pycolmap.Sim3d(1.0, pycolmap.Rotation3d(), [0.0, 0.0, 100.0])
    monkeypatch.setattr(Similarities, "only", lambda _: astray)
    before, models = flights.poses(), flights.atlas.models
    flights.add_waiting([12])
    assert flights.atlas._joiner.join(models) == models
    np.testing.assert_equal(flights.poses(), before)


def test_a_refinement_begun_before_a_join_does_not_touch_the_joined_model(flight):
    with BackgroundAdjuster() as adjuster:
        flights = Flights(flight, adjuster=adjuster)
        until = time.monotonic() + PATIENCE_S
        while not adjuster.is_free and time.monotonic() < until:
            adjuster.poll()
        flights.atlas.settle()
        flights.atlas.models[0].grow([])
        flights.atlas.models[0]._refine_while_growing()
        assert adjuster.is_busy
        flights.atlas.add(flights.add(12))
        assert len(flights.joins) == 1
        while adjuster.is_busy and time.monotonic() < until:
            adjuster.poll()
        before = flights.poses()
        flights.atlas.models[0].grow([])
        np.testing.assert_equal(flights.poses(), before)
        for index in BRIDGES[1:]:
            flights.atlas.add(flights.add(index))
        assert_whole(flights.atlas, flight)


def test_merging_keeps_what_both_have_where_the_first_has_it(flight):
    feed = SceneFeed(flight)
    feed.add_all(range(12))
    models = [Model(feed.scene, OPTIONS.mapper) for _ in range(2)]
    constraints = InitialPairConstraints(min_angle_deg=4, min_inliers=50)
    for model, pair in zip(models, [(2, 1), (8, 7)], strict=True):
        assert model.initialize(*pair, constraints)
        model.grow([3, 4] if model is models[0] else [4, 5, 6])
    first, second = (model.reconstruction for model in models)
    joined = merged(first, second, pycolmap.Sim3d(), [])
    assert set(joined.reg_image_ids()) == {1, 2, 3, 4, 5, 6, 7, 8}
    for image_id in first.reg_image_ids():
        pose = first.image(image_id).cam_from_world().matrix()
        np.testing.assert_array_equal(joined.image(image_id).cam_from_world().matrix(), pose)
    # Keypoints of photo 4 that have a point in both: both are one now.
    both = set(first.image(4).get_observation_point2D_idxs()).intersection(
        second.image(4).get_observation_point2D_idxs()
    )
    assert both
    for index in both:
        point_id = first.image(4).point2D(index).point3D_id
        assert joined.image(4).point2D(index).point3D_id == point_id
        photos = {e.image_id for e in joined.point3D(point_id).track.elements}
        there = second.point3D(second.image(4).point2D(index).point3D_id).track.elements
        assert photos >= {e.image_id for e in there}


@pytest.mark.parametrize(
    "wrong",
    [
        {"min_photos": 0},
        {"retry_growth": 0.5},
    ],
)
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        JoiningOptions(**wrong)


@pytest.mark.parametrize(
    "wrong",
    [
        {"min_matches": 2},
        {"min_bridge_matches": 0},
        {"sample": 1},
        {"min_share": 1.5},
        {"min_agreeing": -0.1},
    ],
)
def test_bridging_options_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        BridgingOptions(**wrong)


@pytest.mark.parametrize("wrong", [{"min_kept": 2}, {"min_common": -1}])
def test_acceptance_options_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        AcceptanceOptions(**wrong)


@pytest.mark.parametrize("wrong", [{"hypotheses": 0}, {"iterations": 0}, {"max_error_px": 0}])
def test_similarity_options_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        SimilarityOptions(**wrong)
