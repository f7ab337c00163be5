"""What the user reads: the live line, plain lines, and the closing summary."""

from __future__ import annotations

import io

import pytest

from sfm_front.cli import progress
from sfm_front.cli.progress import CountLine, ProgressLine
from sfm_front.cli.terminal import ERASE
from sfm_front.events import (
    ControlPointsRefused,
    FinishingBegan,
    FinishingStep,
    ModelRefined,
    ModelTurn,
    PhotoAdded,
)
from sfm_front.types import Skipped, SkipReason


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def turn(monkeypatch):
    """A clock that the test turns."""
    now = [50.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])

    def later(seconds: float) -> None:
        now[0] += seconds

    return later


def expecting(total: int, stream: io.StringIO) -> ProgressLine:
    line = ProgressLine(stream)
    line.expect(total)
    return line


def placed(name: str, registered: int, points: int) -> PhotoAdded:
    return PhotoAdded(name, image_id=1, num_registered=registered, num_points=points)


@pytest.mark.parametrize(("placed_at_last", "told"), [(0, 1), (2, 0)])
def test_photos_that_all_wait_are_explained_once(placed_at_last, told):
    stream = io.StringIO()
    line = expecting(30, stream)
    for number in range(25):
        line.show(placed(f"{number}.jpg", placed_at_last if number > 10 else 0, 0))
    assert stream.getvalue().count("no photo is placed yet") == told


def test_without_a_terminal_there_is_a_line_a_photo(turn):
    stream = io.StringIO()
    line = expecting(4, stream)
    turn(2.0)
    line.show(placed("a.jpg", 0, 0))
    turn(4.0)
    line.show(placed("b.jpg", 2, 150))
    assert stream.getvalue().splitlines() == [
        "photo 1 of 4: 0 placed, 0 points  2.00 s a photo  0:06 left",
        "photo 2 of 4: 2 placed, 150 points  3.00 s a photo  0:06 left",
    ]


def test_a_skipped_photo_is_named_with_its_reason_and_counts(turn):
    stream = io.StringIO()
    line = expecting(3, stream)
    line.show(placed("a.jpg", 5, 70))
    turn(1.0)
    skipped = Skipped("süd/b.jpg", SkipReason.DUPLICATE, "same file as a.jpg")
    line.show(skipped)
    lines = stream.getvalue().splitlines()
    assert lines[1] == "skipped süd/b.jpg: duplicate: same file as a.jpg"
    # The skipped photo takes nothing away from what is placed.
    assert lines[2].startswith("photo 2 of 3: 5 placed, 70 points")


def test_on_a_terminal_one_line_renews_itself(turn, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    stream = Terminal()
    line = expecting(200, stream)
    for number in range(3):
        turn(1.0)
        line.show(placed(f"{number}.jpg", number, 1_000_000))
    assert "\n" not in stream.getvalue()
    shown = stream.getvalue().split("\r\x1b[K")[1:]
    assert [text.split(":")[0] for text in shown] == [f"photo {n} of 200" for n in (1, 2, 3)]
    assert all(len(text) < 40 for text in shown)


def test_a_note_on_a_terminal_stays():
    stream = Terminal()
    line = expecting(2, stream)
    line.show(placed("a.jpg", 0, 0))
    line.note("stopping")
    line.end()
    assert stream.getvalue().endswith("\r\x1b[Kstopping\n\r\x1b[K")


def test_long_runs_are_told_in_hours(turn):
    stream = io.StringIO()
    line = expecting(3601, stream)
    turn(2.0)
    line.show(placed("a.jpg", 0, 0))
    assert stream.getvalue().endswith("2:00:00 left\n")


def test_what_becomes_of_models_is_no_photo(turn):
    stream = io.StringIO()
    line = expecting(2, stream)
    line.show(ModelRefined(1, 2, 150, seconds=0.5))
    assert stream.getvalue() == ""
    turn(1.0)
    line.show(placed("a.jpg", 0, 0))
    assert stream.getvalue().startswith("photo 1 of 2")


def test_what_can_be_mended_while_photos_come_is_told_then_and_else_in_the_summary():
    stream = io.StringIO()
    line = ProgressLine(stream)
    line.show(ControlPointsRefused("line 7 is wrong."))
    line.show(FinishingBegan(FinishingStep.CONTROL_POINTS))
    line.show(ControlPointsRefused("line 8 is wrong."))
    first, _ = stream.getvalue().splitlines()
    assert first == "control points cannot be used: line 7 is wrong."


def adjusted(model_id: int, num_photos: int, number: int = 1, num_models: int = 1):
    turn = ModelTurn(model_id, number, num_models, num_photos)
    return FinishingBegan(FinishingStep.LAST_ADJUSTMENT, 4, 6, turn)


def test_the_end_is_told_by_steps_and_models():
    stream = io.StringIO()
    line = ProgressLine(stream)
    line.show(FinishingBegan(FinishingStep.REFINE, 2, 6))
    line.show(adjusted(3, 40, 2, 3))
    assert stream.getvalue().splitlines() == [
        "finishing 2 of 6: refining the models",
        "finishing 4 of 6: last adjustment of all cameras and points (model 2 of 3, 40 photos)",
    ]


@pytest.mark.parametrize(
    ("refined_s", "said"),
    [(0.1, ""), (10.0, ", usually 0:40 to 2:40"), (2.5, ", usually up to 0:40")],
)
def test_how_long_the_last_adjustment_takes_is_told_by_the_refinement_before(refined_s, said):
    stream = io.StringIO()
    line = ProgressLine(stream)
    line.show(ModelRefined(1, 500, 9000, seconds=refined_s))
    line.show(ModelRefined(2, 500, 9000, seconds=77.0))  # Of another model.
    line.show(adjusted(1, 1000))
    assert stream.getvalue().splitlines()[-1].partition("(1000 photos)")[2] == said


def test_counting_without_a_terminal_takes_a_line_each_tenth(turn):
    stream = io.StringIO()
    line = CountLine("indexing photo", stream)
    for done in range(1, 41):
        turn(0.5)
        line.show(done, 40)
    line.end()
    lines = stream.getvalue().splitlines()
    assert len(lines) == 10
    assert lines[0] == "indexing photo 4 of 40  0.50 s a photo  0:18 left"
    assert lines[-1].startswith("indexing photo 40 of 40")


def test_counting_on_a_terminal_renews_one_line_and_leaves_none():
    terminal = Terminal()
    line = CountLine("indexing photo", terminal)
    for done in (1, 2, 3):
        line.show(done, 3)
    line.end()
    assert "\n" not in terminal.getvalue()
    assert "indexing photo 2 of 3" in terminal.getvalue()
    assert terminal.getvalue().endswith("\r\x1b[K")


def test_counting_a_few_photos_without_a_terminal_names_each():
    stream = io.StringIO()
    line = CountLine("photo", stream)
    for done in (1, 2, 3):
        line.show(done, 3)
    assert [text.split()[1] for text in stream.getvalue().splitlines()] == ["1", "2", "3"]


def test_quiet_leaves_only_what_must_be_mended():
    terminal, log = Terminal(), io.StringIO()
    for stream in (terminal, log):
        line = ProgressLine(stream, quiet=True)
        line.expect(2)
        line.note("continuing out")
        line.show(placed("a.jpg", 0, 0))
        line.show(Skipped("b.jpg", SkipReason.EMPTY_FILE))
        line.step("last adjustment")
        line.close()
    assert terminal.getvalue() == log.getvalue() == ""
    line.show(ControlPointsRefused("line 7 is wrong."))
    assert log.getvalue() == "control points cannot be used: line 7 is wrong.\n"


def test_no_name_of_a_photo_moves_the_cursor():
    stream = Terminal()
    ProgressLine(stream).show(Skipped("a\x1b[2J\x1b]0;title\x07\r\nb.jpg", SkipReason.EMPTY_FILE))
    assert (
        stream.getvalue()
        .replace(ERASE, "")
        .startswith("skipped a\\x1b[2J\\x1b]0;title\\x07\\x0d\\x0ab.jpg: empty file\n")
    )
