"""The end of a session: what is told before the last adjustment of its models."""

from __future__ import annotations

from helpers.photo_stream import SceneFeed

from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.mapping.atlas import Atlas, AtlasOptions
from sfm_front.mapping.finishing import finish
from sfm_front.mapping.mapper_options import MapperOptions

NUM_PHOTOS = 14


class NeverDone:
    """A process that has taken a model and does not answer."""

    is_busy = is_broken = False

    @property
    def is_free(self) -> bool:
        return not self.is_busy

    def poll(self) -> None:
        pass

    def submit(self, *_: object) -> int:
        self.is_busy = True
        return 1


def test_no_model_is_refined_in_the_background_before_its_last_adjustment():
    adjuster, seen = NeverDone(), []
    options = AtlasOptions(mapper=MapperOptions(num_threads=1))
    flight = make_scene(NUM_PHOTOS, 250, seed=3, layout="strip")
    atlas = Atlas(SceneFeed(flight).scene, options, adjuster=adjuster)
    feed = SceneFeed(flight, atlas.view_graph)
    for index in range(NUM_PHOTOS):
        atlas.add(feed.add(index))
    atlas.settle()
    assert atlas.models[0].is_under_way
    finish(atlas, before_last=lambda: seen.append([model.is_under_way for model in atlas.models]))
    assert seen == [[False]]
    assert atlas.models[0].num_registered == NUM_PHOTOS
