"""Photos that are poorly connected are matched again: pairs that were missed are found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pycolmap
import pytest
from helpers.photo_stream import described, position_errors_m

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import Event, LookedAgain, PhotoPlaced
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.session.options import SessionOptions
from sfm_front.session.pair_matching import PairMatchingOptions
from sfm_front.session.second_look import SecondLookOptions
from sfm_front.session.session import Session
from sfm_front.session.summing_up import SessionResult

NUM_PHOTOS = 12
POSITION_TOLERANCE_M = 0.3
# Long enough to be used.
IDLE_S = 2.0
# The first to arrive are from opposite sides: when they come they overlap with nothing.
SCATTERED = (0, 6, 3, 9, 1, 7, 4, 10, 2, 8, 5, 11)


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    """Each photo overlaps with two on either side."""
    return make_scene(NUM_PHOTOS, 400, seed=1, layout="orbit")


def short_sighted(**second_look: float) -> SessionOptions:
    """A session that matches each photo that arrives with its nearest one alone."""
    return SessionOptions(
        global_descriptor="vlad",
        threads=1,
        retrieval=RetrievalOptions(candidates=1, num_expansion=0),
        pair_matching=PairMatchingOptions(num_matched=1, num_matched_first=1),
        second_look=SecondLookOptions(**second_look),
    )


def run(
    orbit: SyntheticScene, output: Path, options: SessionOptions, order: Sequence[int] | None = None
) -> tuple[SessionResult, list[LookedAgain]]:
    events: list[Event] = []
    with Session(output, options, on_event=events.append) as session:
        for index in order or range(len(orbit)):
            session.add_extracted(described(orbit, index))
        result = session.finish()
    return result, [event for event in events if isinstance(event, LookedAgain)]


def verified_pairs(output: Path) -> int:
    with pycolmap.Database.open(output / "database.db") as database:
        return int(database.num_verified_image_pairs())


@pytest.fixture(scope="module")
def looked(orbit, tmp_path_factory) -> tuple[Path, SessionResult, list[LookedAgain]]:
    output = tmp_path_factory.mktemp("looked")
    return output, *run(orbit, output, short_sighted(), SCATTERED)


def test_every_photo_is_placed_that_was_matched_with_too_few(orbit, looked):
    _, result, _ = looked
    assert [model.num_registered for model in result.models] == [NUM_PHOTOS]
    errors = position_errors_m(result.models[0].reconstruction, orbit)
    assert errors.max() < POSITION_TOLERANCE_M


def test_without_the_budget_for_it_those_photos_are_lost(orbit, looked, tmp_path):
    output, _, _ = looked
    result, events = run(orbit, tmp_path, short_sighted(pairs_per_photo=0), SCATTERED)
    assert result.summary.totals.num_registered < NUM_PHOTOS
    assert verified_pairs(tmp_path) < verified_pairs(output)
    assert not events


def test_what_is_found_is_told_and_written_down(looked):
    output, _, events = looked
    found = sum(len(event.found) for event in events)
    assert found > 0
    # Each photo but the first was matched with one when it arrived.
    assert verified_pairs(output) <= NUM_PHOTOS - 1 + found
    assert verified_pairs(output) >= found


def test_no_pair_is_matched_twice_and_the_budget_is_kept(orbit, tmp_path):
    budget = 2
    _, events = run(orbit, tmp_path, short_sighted(pairs_per_photo=budget))
    assert 0 < sum(event.num_tried for event in events) <= budget * NUM_PHOTOS
    assert events[-1].num_left == budget * NUM_PHOTOS - sum(event.num_tried for event in events)
    assert min(event.num_left for event in events) >= 0


def test_a_sparse_capture_is_looked_at_closely_at_the_end(orbit, tmp_path):
    """Though its pairs may not all be matched: five a photo are not enough for all of twelve."""
    num_found = []
    for share in (1.0, 0.2):
        options = short_sighted(pairs_per_photo=5, hurried_candidates=0, sparse_share=share)
        result, _ = run(orbit, tmp_path / str(share), options, SCATTERED)
        num_found.append(result.summary.totals.num_registered)
    assert num_found[0] < num_found[1] == NUM_PHOTOS


def test_a_photo_may_overlap_with_one_that_came_later(looked):
    _, _, events = looked
    assert any(other > event.image_id for event in events for other in event.found)


def test_well_connected_photos_are_not_looked_at(tmp_path):
    """But for the first ones, which wait until a model can start."""
    dense = make_scene(20, 300, seed=1, layout="orbit")
    options = SessionOptions(global_descriptor="vlad", threads=1)
    result, events = run(dense, tmp_path, options)
    assert result.summary.totals.num_registered == len(dense) == 20
    assert sum(event.num_tried for event in events) <= 3


def test_it_happens_while_nothing_arrives(orbit, tmp_path):
    events: list[Event] = []
    with Session(tmp_path, short_sighted(), on_event=events.append) as session:
        for index in SCATTERED:
            session.add_extracted(described(orbit, index))
        num_before = len(events)
        for _ in range(100):
            session.idle(IDLE_S)
        num_events = len(events)
        looks = [event for event in events[num_before:] if isinstance(event, LookedAgain)]
        assert any(event.found for event in looks)
        assert sum(isinstance(event, PhotoPlaced) for event in events) == NUM_PHOTOS
        session.idle(IDLE_S)
        assert len(events) == num_events


@pytest.mark.parametrize("name", ["pairs_per_photo", "candidates", "patience", "per_model"])
def test_options_are_checked(name):
    with pytest.raises(ConfigError, match=name):
        SecondLookOptions(**{name: -1})
