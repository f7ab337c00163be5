"""Models against the verified pairs of their photos, over a scene with known truth."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest
from helpers.lookalike_walk import NUM_PHOTOS, LookAlikeWalk

from sfm_front.mapping.audit import agreeing, audit, misplaced


@pytest.fixture(scope="module")
def walk() -> LookAlikeWalk:
    return LookAlikeWalk()


def without_false_pairs(walk: LookAlikeWalk):
    """The view graph with only the matches that the true poses agree with."""
    graph, model = walk.view_graph(), walk.model(folded=False)
    found = agreeing(model, graph, graph.pairs(graph.image_ids))
    graph.keep_only({pair: matches[agrees] for pair, matches, agrees in found})
    return graph


def test_the_true_model_agrees_with_its_true_pairs(walk):
    audited = audit(walk.model(folded=False), without_false_pairs(walk))
    assert audited.num_pairs > NUM_PHOTOS
    assert audited.num_contradicted == 0
    assert audited.contradicted_share == audited.worst_share == 0
    assert audited.worst_parts is None
    assert not audited.is_doubtful


def test_a_photo_that_stands_elsewhere_is_named(walk):
    model = walk.model(folded=False)
    last = model.image(NUM_PHOTOS)
    aside = pycolmap.Rigid3d(pycolmap.Rotation3d(), np.array([0.0, 3.0, 1.0]))
    last.frame.set_cam_from_world(1, last.cam_from_world() * aside)
    audited = audit(model, without_false_pairs(walk))
    assert audited.worst_parts == (tuple(range(1, NUM_PHOTOS)), (NUM_PHOTOS,))
    assert audited.worst_share > 0.9
    assert audited.is_doubtful
    assert misplaced(model, without_false_pairs(walk)) == audited.worst_parts


def test_two_photos_that_stand_elsewhere_together_are_misplaced(walk):
    """They stand to each other as before, and agree."""
    model = walk.model(folded=False)
    aside = pycolmap.Rigid3d(pycolmap.Rotation3d(), np.array([0.0, 3.0, 1.0]))
    moved = (NUM_PHOTOS - 1, NUM_PHOTOS)
    for image_id in moved:
        image = model.image(image_id)
        image.frame.set_cam_from_world(1, image.cam_from_world() * aside)
    others = tuple(range(1, NUM_PHOTOS - 1))
    assert misplaced(model, without_false_pairs(walk)) == (others, moved)


def test_no_photo_of_a_true_model_is_misplaced(walk):
    assert misplaced(walk.model(folded=False), without_false_pairs(walk)) is None


def test_a_folded_model_contradicts_the_pairs_that_it_tears_apart(walk):
    audited = audit(walk.model(folded=True), walk.view_graph())
    assert audited.num_contradicted > 0
    assert audited.is_doubtful
