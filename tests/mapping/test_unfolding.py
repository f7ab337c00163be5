"""What look-alike things have folded comes apart, and together again the right way."""

from __future__ import annotations

import numpy as np
import pycolmap
from helpers.lookalike_walk import NUM_PHOTOS, LookAlikeWalk
from helpers.photo_stream import SceneFeed, centre_of, position_errors_m

from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.events import Evidence, LookAlikesRefused
from sfm_front.mapping.atlas import Atlas, AtlasOptions
from sfm_front.mapping.audit import agreeing, audit
from sfm_front.mapping.finishing import finish
from sfm_front.mapping.mapper_options import MapperOptions
from sfm_front.mapping.model_state import ModelState
from sfm_front.mapping.unfolding import unfold

OPTIONS = AtlasOptions(mapper=MapperOptions(num_threads=1))


def atlas_of(walk, emit, *, folded):
    atlas = Atlas(walk.view_graph(), OPTIONS, emit)
    state = ModelState(
        model_id=1,
        refined_images=NUM_PHOTOS,
        refined_points=1000,
        min_pose_inliers=30,
        refine_intrinsics=True,
    )
    atlas.restore([(walk.model(folded=folded), state)])
    return atlas


def assert_true(atlas, walk):
    """One model, of all photos, each where it was taken."""
    assert [model.num_registered for model in atlas.models] == [NUM_PHOTOS]
    model = atlas.models[0].reconstruction
    found = np.array([model.image(i + 1).projection_center() for i in range(NUM_PHOTOS)])
    truth = np.array([centre_of(pose) for pose in walk.poses])
    truth_from_model = pycolmap.estimate_sim3d(found, truth)
    assert truth_from_model is not None
    assert np.linalg.norm(truth_from_model * found - truth, axis=1).max() < 0.1


def test_a_true_model_stays_as_it_is():
    walk, events = LookAlikeWalk(), []
    atlas = atlas_of(walk, events.append, folded=False)
    before = atlas.models[0]
    assert not unfold(atlas)
    assert atlas.models == [before]
    assert events == []


def test_a_folded_model_is_taken_apart_and_joined_by_true_matches():
    walk, events = LookAlikeWalk(), []
    atlas = atlas_of(walk, events.append, folded=True)
    finish(atlas)
    assert any(isinstance(event, LookAlikesRefused) for event in events)
    assert_true(atlas, walk)


def test_a_session_that_waits_takes_a_folded_model_apart():
    walk = LookAlikeWalk()
    atlas = atlas_of(walk, lambda _: None, folded=True)
    while not atlas.settle():
        pass
    assert unfold(atlas)
    assert atlas.settle()
    assert not unfold(atlas)
    assert_true(atlas, walk)


def test_most_matches_do_not_outvote_the_surroundings():
    """The look-alikes match each other in many photos, and few hold the true model together."""
    walk = LookAlikeWalk()
    atlas = atlas_of(walk, lambda _: None, folded=False)
    model, graph = atlas.models[0], atlas.view_graph
    found = agreeing(model.reconstruction, graph, graph.pairs(model.registered))
    graph.keep_only(
        {
            (late, early): matches[:0]
            for (late, early), matches, agrees in found
            if early <= NUM_PHOTOS // 2 < late - 2 and agrees.mean() > 0.5
        }
    )
    atlas.replace(model, [model.registered])
    audited = audit(model.reconstruction, graph)
    assert audited.worst_share > 0.5
    finish(atlas)
    assert_true(atlas, walk)


def test_a_photo_that_its_matches_contradict_is_put_right():
    num_photos, events = 12, []
    scene = make_scene(num_photos, 500, seed=4, layout="orbit")
    feed = SceneFeed(scene)
    feed.add_all(range(num_photos))
    atlas = Atlas(feed.scene, OPTIONS, events.append)
    finish(atlas)
    model = atlas.models[0].reconstruction
    wrong, elsewhere = model.image(5), model.image(9).cam_from_world()
    model.deregister_frame(wrong.frame_id)
    wrong.frame.set_cam_from_world(1, elsewhere)
    model.register_frame(wrong.frame_id)
    assert unfold(atlas)
    refused = [event for event in events if isinstance(event, LookAlikesRefused)]
    assert [event.evidence for event in refused] == [Evidence.MATCHES]
    assert refused[0].image_ids == ((1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12), (5,))
    assert atlas.models[0].num_registered == num_photos
    assert position_errors_m(atlas.models[0].reconstruction, scene).max() < 0.15
