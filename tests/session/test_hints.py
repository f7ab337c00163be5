"""What would help a photo that ended in no model."""

from __future__ import annotations

import pytest
from helpers.photo_stream import SceneFeed

from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.session.hints import hint


@pytest.fixture(scope="module")
def view_graph() -> ViewGraph:
    """Image ids 1 to 4: three photos side by side, and one from the other side."""
    feed = SceneFeed(make_scene(12, 300, seed=3, layout="orbit"))
    feed.add_all([0, 1, 2, 6])
    return feed.scene


def test_a_photo_that_shares_too_little_with_the_model_is_to_be_linked_with_those(view_graph):
    told = hint(3, view_graph, {1, 2}, [4, 1, 2])
    assert told == "take one between it and 000001.jpg, 000000.jpg, which share too little"


def test_a_group_is_to_be_linked_with_the_most_similar_registered_photo(view_graph):
    told = hint(3, view_graph, {4}, [1, 4, 3])
    assert told == (
        "overlaps only with 000001.jpg, 000000.jpg: if 000006.jpg show the same place, take some "
        "between"
    )


def test_a_photo_without_pairs_is_told_of_the_most_similar_ones(view_graph):
    told = hint(4, view_graph, {1, 2, 3}, [4, 2, 1])
    assert told.startswith("most similar are 000001.jpg, 000000.jpg: if they show the same place")


def test_without_a_model_there_is_nothing_to_link_to(view_graph):
    assert hint(4, view_graph, set(), [1, 2, 3]) == ""
